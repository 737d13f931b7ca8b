"""Long vertical edges of one image, as fitted lines: door frames, furniture, wall corners.

Extrema of the horizontal gradient are linked down the rows (connected components of equal sign)
and a line u = u_0 + slope (v - v_0) is fitted to their sub-pixel places.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

MIN_ROWS = 25
MIN_FILLED = 0.7
MAX_SLOPE = 0.035
MAX_RMS_PX = 0.6
MAX_BOX_PX = 6
MIN_GRADIENT = 2.0  # times the noise, grey levels per pixel
SMOOTH_ROWS = (1, 5)


@dataclass(frozen=True, slots=True, eq=False)
class Lines:
    """Edges (n,) of one image: column at row `v`, slope, first and last row, sign, strength."""

    u: np.ndarray
    v: np.ndarray
    slope: np.ndarray
    top: np.ndarray
    bottom: np.ndarray
    sign: np.ndarray
    strength: np.ndarray

    def at(self, v: np.ndarray) -> np.ndarray:
        """Column of the lines at rows `v` (broadcast against n)."""
        return self.u + self.slope * (v - self.v)


def find_lines(image: np.ndarray, noise: float) -> Lines:
    """All vertical edges of a smoothed grey image (h, w)."""
    tall = cv2.blur(image, SMOOTH_ROWS)
    gradient = cv2.Sobel(tall, cv2.CV_32F, 1, 0, ksize=3, scale=0.125)
    # Smoothing by the Gaussian, the five rows and Sobel's own three leaves a tenth of the noise.
    limit = max(MIN_GRADIENT * noise, 1.0)
    strength = cv2.absdiff(gradient, 0.0)
    centre = strength[:, 1:-1]
    peak = (centre > limit) & (centre >= strength[:, :-2]) & (centre > strength[:, 2:])
    rising = gradient[:, 1:-1] > 0
    # Both signs in one image, one above the other, so that they are labelled together.
    both = np.vstack([peak & rising, peak & ~rising]).view(np.uint8)
    _, label, box, _ = cv2.connectedComponentsWithStats(both, connectivity=8)
    long = box[:, cv2.CC_STAT_HEIGHT] >= MIN_ROWS
    long &= box[:, cv2.CC_STAT_WIDTH] <= MAX_BOX_PX
    long &= box[:, cv2.CC_STAT_AREA] >= MIN_FILLED * box[:, cv2.CC_STAT_HEIGHT]
    long[0] = False  # the background
    return _fit(strength, label, long)


def _fit(strength: np.ndarray, label: np.ndarray, long: np.ndarray) -> Lines:
    height = strength.shape[0]
    number = np.cumsum(long) - 1
    row, column = np.nonzero(long[label])
    which = number[label[row, column]]
    falling = row >= height
    v, u = np.where(falling, row - height, row), column + 1
    left, middle, right = (strength[v, u + k].astype(np.float64) for k in (-1, 0, 1))
    bend = left - 2.0 * middle + right
    u = u + np.where(bend < 0, 0.5 * (left - right) / np.minimum(bend, -1e-9), 0.0)
    count = max(int(long.sum()), 0)

    def total(values: np.ndarray) -> np.ndarray:
        return np.bincount(which, weights=values, minlength=count)

    n = np.maximum(total(np.ones(len(u))), 1.0)
    mean_v, mean_u = total(v) / n, total(u) / n
    dv, du = v - mean_v[which], u - mean_u[which]
    slope = total(dv * du) / np.maximum(total(dv * dv), 1e-9)
    rms = np.sqrt(total((du - slope[which] * dv) ** 2) / n)
    top, bottom = np.full(count, height), np.full(count, -1)
    np.minimum.at(top, which, v)
    np.maximum.at(bottom, which, v)
    sign = np.where(total(falling.astype(float)) > 0.5 * n, -1, 1)
    good = (np.abs(slope) < MAX_SLOPE) & (rms < MAX_RMS_PX) & (bottom - top + 1 >= MIN_ROWS)
    fields = (mean_u, mean_v, slope, top, bottom, sign, total(middle) / n)
    return Lines(*(field[good] for field in fields))
