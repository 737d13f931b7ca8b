"""How far a disparity map is from the truth: bad-N, end-point error, density.

Disparities are float (h, w) px at 320 wide, NaN where unknown. Truth counts where it is known and
0 < d < 64. The measures are those of the KITTI (Geiger et al., CVPR 2012) and Middlebury
(Scharstein and Szeliski, IJCV 2002) benchmarks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

MAX_DISPARITY_PX = 64.0
NAN = float("nan")


@dataclass(frozen=True, slots=True)
class StereoErrors:
    """Shares in percent of the pixels with truth; an empty pixel is an error in bad-N.

    `density_pct` is the share that has an estimate; `epe_px` is the mean absolute error over
    those, NaN if there are none.
    """

    density_pct: float
    bad1_pct: float
    bad2_pct: float
    bad3_pct: float
    epe_px: float


def countable(truth_px: np.ndarray, max_px: float = MAX_DISPARITY_PX) -> np.ndarray:
    """Bool (h, w): pixels whose truth is known and within 0 < d < `max_px`."""
    known = np.isfinite(truth_px)
    value = np.where(known, truth_px, 0.0)
    return known & (value > 0) & (value < max_px)


def stereo_errors(
    estimate_px: np.ndarray,
    truth_px: np.ndarray,
    mask: np.ndarray | None = None,
    max_px: float = MAX_DISPARITY_PX,
) -> StereoErrors:
    """Measure an estimate; `mask` bool (h, w) limits the pixels (None: all with truth).

    Raises ValueError if the shapes differ. Without a single countable pixel all is NaN.
    """
    if estimate_px.shape != truth_px.shape:
        raise ValueError(f"estimate {estimate_px.shape} and truth {truth_px.shape} differ in size")
    counted = countable(truth_px, max_px)
    if mask is not None:
        counted &= mask
    if not counted.any():
        return StereoErrors(NAN, NAN, NAN, NAN, NAN)
    estimate, truth = estimate_px[counted].astype(np.float64), truth_px[counted]
    there = np.isfinite(estimate)
    off = np.abs(np.where(there, estimate, np.inf) - truth)
    bad = [100.0 * float((off > n).mean()) for n in (1, 2, 3)]
    epe = float(off[there].mean()) if there.any() else NAN
    return StereoErrors(100.0 * float(there.mean()), bad[0], bad[1], bad[2], epe)


def fill_background(disparity_px: np.ndarray) -> np.ndarray:
    """Fill gaps as KITTI does: along the row with the farther (smaller) of both neighbours.

    A gap at a border takes its one neighbour; a row without any takes the nearest row that has
    some. A map without any value stays NaN.
    """
    known = np.isfinite(disparity_px)
    some = known.any(axis=1)
    if not some.any():
        return np.full(known.shape, np.nan, np.float32)
    width = known.shape[1]
    filled = disparity_px.astype(np.float32)
    gaps = np.flatnonzero(~known)
    # A run of gaps ends where the next gap is not its neighbour, or begins a row.
    starts = np.ones(len(gaps), np.bool_)
    starts[1:] = (np.diff(gaps) != 1) | (gaps[1:] % width == 0)
    first = gaps[starts]
    last = gaps[np.append(starts[1:], True)] if len(gaps) else gaps
    row = first // width
    padded = np.pad(np.where(known, filled, np.inf), ((0, 0), (1, 1)), constant_values=np.inf)
    farther = np.minimum(padded[row, first % width], padded[row, last % width + 2])
    filled.reshape(-1)[gaps] = farther[np.cumsum(starts) - 1]
    if some.all():
        return filled
    present = np.flatnonzero(some)
    nearest = np.abs(np.arange(len(some))[:, None] - present).argmin(axis=1)
    return filled[present[nearest]]


def mean_errors(errors: list[StereoErrors]) -> StereoErrors:
    """Mean of each measure over pairs; pairs where a measure is NaN do not count for it."""
    names = StereoErrors.__slots__
    columns = [np.array([getattr(e, n) for e in errors], dtype=np.float64) for n in names]
    means = [float(c[np.isfinite(c)].mean()) if np.isfinite(c).any() else NAN for c in columns]
    return StereoErrors(*means)
