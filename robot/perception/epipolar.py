"""Do both eyes still stand as they were calibrated? Matching points must lie on the same row.

A camera that was knocked shows as rows that no longer match: by a constant when it nods, along the
columns when it rolls. (Turning it sideways changes disparities only, which no pair can tell.)
"""

from __future__ import annotations

from collections import deque
from typing import Any

import cv2
import numpy as np

WARN_PX = 0.8  # matchers suffer from about a pixel on
LOOKS = 12  # pictures that are judged together
MIN_POINTS = 60
_CORNERS, _QUALITY, _SPACING_PX = 80, 0.02, 10
_BACK_PX, _MAX_ROWS_PX = 0.3, 6.0
_FLOW: Any = {
    "winSize": (15, 15),
    "maxLevel": 4,
    "criteria": (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 20, 0.01),
}


class EpipolarWatch:
    """Looks at rectified pairs now and then; `offset_px` says how far rows are apart."""

    def __init__(self, warn_px: float = WARN_PX) -> None:
        self._warn_px = warn_px
        self._looks: deque[np.ndarray] = deque(maxlen=LOOKS)
        self.offset_px = float("nan")

    def look(self, left: np.ndarray, right: np.ndarray) -> None:
        """Learn from a rectified pair (h, w) uint8."""
        self._looks.append(row_offsets(left, right))
        points = np.concatenate(self._looks)
        if len(self._looks) >= LOOKS // 2 and len(points) >= MIN_POINTS:
            self.offset_px = _fitted_px(points, left.shape)

    @property
    def problem(self) -> str:
        """What is wrong, in words; empty while all is well or nothing is known."""
        if not self.offset_px > self._warn_px:
            return ""
        return (
            f"rows of the two eyes are {self.offset_px:.1f} px apart: a camera has moved since "
            "the calibration"
        )


def row_offsets(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Matching points of a rectified pair (n, 3): u, v in the left eye, and rows v' - v apart."""
    corners = cv2.goodFeaturesToTrack(left, _CORNERS, _QUALITY, _SPACING_PX)
    if corners is None:
        return np.empty((0, 3))
    there, found, _ = cv2.calcOpticalFlowPyrLK(left, right, corners, corners.copy(), **_FLOW)
    back, returned, _ = cv2.calcOpticalFlowPyrLK(right, left, there, there.copy(), **_FLOW)
    start, end = corners[:, 0], there[:, 0]
    step = end - start
    good = (found[:, 0] > 0) & (returned[:, 0] > 0)
    good &= np.linalg.norm(back[:, 0] - start, axis=1) < _BACK_PX
    good &= (step[:, 0] < 1.0) & (step[:, 0] > -0.25 * left.shape[1])  # to the left, not too far
    good &= np.abs(step[:, 1]) < _MAX_ROWS_PX
    return np.column_stack([start[good], step[good, 1]])


def _fitted_px(points: np.ndarray, shape: tuple[int, ...]) -> float:
    """RMS over the image of the plane through the offsets, outliers weighted down (Huber)."""
    centre, scale = np.array([shape[1], shape[0]]) / 2.0, max(shape) / 2.0
    design = np.column_stack([np.ones(len(points)), (points[:, :2] - centre) / scale])
    weight = np.ones(len(points))
    for _ in range(8):
        root = np.sqrt(weight)[:, None]
        plane = np.linalg.lstsq(design * root, points[:, 2] * root[:, 0], rcond=None)[0]
        error = np.abs(points[:, 2] - design @ plane)
        spread = max(1.4826 * float(np.median(error)), 0.02)
        weight = 1.0 / np.maximum(1.0, error / (1.5 * spread))
    half = np.array([shape[1], shape[0]]) / 2.0 / scale
    # Mean square of a plane over a rectangle: c0^2 + (c1 a)^2 / 3 + (c2 b)^2 / 3.
    return float(np.sqrt(plane[0] ** 2 + np.sum((plane[1:] * half) ** 2) / 3.0))
