"""KITTI's own measures and error picture (Menze and Geiger, CVPR 2015; Geiger et al., CVPR 2012).

A pixel is an outlier of KITTI 2015 (D1) when it is off by at least 3 px and by at least 5 % of the
true disparity; of KITTI 2012 (Out) when it is off by more than 3 px. Both are measured at full
size, over pixels with truth, on maps without gaps. Empty pixels count as outliers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

ABSOLUTE_PX, RELATIVE = 3.0, 0.05
NAN = float("nan")

# Lower bounds of the error over its tolerance, and the colour (red, green, blue) from there on:
# blue is right, from 1 on yellow to red is wrong.
COLOURS = (
    (0.0, (49, 54, 149)),
    (0.0625, (69, 117, 180)),
    (0.125, (116, 173, 209)),
    (0.25, (171, 217, 233)),
    (0.5, (224, 243, 248)),
    (1.0, (254, 224, 144)),
    (2.0, (253, 174, 97)),
    (4.0, (244, 109, 67)),
    (8.0, (215, 48, 39)),
    (16.0, (165, 0, 38)),
)


@dataclass(frozen=True, slots=True)
class KittiErrors:
    """Percent of outliers among background, foreground and all pixels, and KITTI 2012's two.

    `avg_px` is the mean error over pixels with an estimate. NaN where there is no such pixel.
    """

    d1_bg_pct: float
    d1_fg_pct: float
    d1_all_pct: float
    out_pct: float
    avg_px: float


def _off(estimate_px: np.ndarray, truth_px: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Absolute error, infinite where there is no estimate, and which pixels have truth."""
    if estimate_px.shape != truth_px.shape:
        raise ValueError(f"estimate {estimate_px.shape} and truth {truth_px.shape} differ in size")
    known = np.isfinite(truth_px) & (np.nan_to_num(truth_px) > 0)
    there = np.isfinite(estimate_px)
    off = np.where(there, np.abs(np.nan_to_num(estimate_px) - np.nan_to_num(truth_px)), np.inf)
    return off, known


def _share(bad: np.ndarray, among: np.ndarray) -> float:
    return 100.0 * float(bad[among].mean()) if among.any() else NAN


def kitti_errors(
    estimate_px: np.ndarray, truth_px: np.ndarray, foreground: np.ndarray | None = None
) -> KittiErrors:
    """Measure an estimate (h, w) px, NaN where empty; `foreground` bool (h, w) marks objects.

    Raises ValueError if the shapes differ.
    """
    off, known = _off(estimate_px, truth_px)
    outlier = (off >= ABSOLUTE_PX) & (off >= RELATIVE * np.nan_to_num(truth_px))
    front = np.zeros_like(known) if foreground is None else foreground
    there = known & np.isfinite(off)
    return KittiErrors(
        _share(outlier, known & ~front),
        _share(outlier, known & front),
        _share(outlier, known),
        _share(off > ABSOLUTE_PX, known),
        float(off[there].mean()) if there.any() else NAN,
    )


def kitti_error_picture(estimate_px: np.ndarray, truth_px: np.ndarray) -> np.ndarray:
    """Error as KITTI 2015 colours it: uint8 (h, w, 3), red first; black without truth.

    The colour tells the error as a multiple of its tolerance, the larger of 3 px and 5 %.
    """
    off, known = _off(estimate_px, truth_px)
    tolerance = np.maximum(ABSOLUTE_PX, RELATIVE * np.nan_to_num(truth_px))
    bounds = np.array([b for b, _ in COLOURS[1:]])
    level = np.searchsorted(bounds, off / tolerance, side="right")
    table = np.array([colour for _, colour in COLOURS], np.uint8)
    return table[level] * known[..., None].astype(np.uint8)
