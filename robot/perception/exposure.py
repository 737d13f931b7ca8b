"""Both eyes at the same brightness.

Two cameras never agree on exposure, and matching compares grey levels. The means of the images
differ by what each sees alone, so the gain is learnt from pixels that were matched: there both
eyes see the same thing.
"""

from __future__ import annotations

import cv2
import numpy as np

GAIN_RANGE = (0.5, 2.0)
LEARN = 0.3  # share of a newly measured change that is taken over
STEP_PX = 8  # every eighth row and column is plenty
MIN_PIXELS = 50
MIN_GREY, MAX_GREY = 10, 245  # darker is noise, brighter may be clipped


class Exposure:
    """The right eye's gain relative to the left one's, followed over frames."""

    def __init__(self) -> None:
        self._gain: float | None = None

    def match(self, left: np.ndarray, right: np.ndarray) -> np.ndarray:
        """The right image (grey uint8) as bright as the left one."""
        if self._gain is None:
            self._gain = _limited(float(left.mean()) / max(float(right.mean()), 1.0))
        table = np.rint(np.arange(256) * self._gain)
        return cv2.LUT(right, np.clip(table, 0, 255).astype(np.uint8))

    def learn(self, left: np.ndarray, right: np.ndarray, disparity_px: np.ndarray) -> None:
        """Correct the gain by a pair that `match` made alike, and its disparity (h, w)."""
        disparity = disparity_px[::STEP_PX, ::STEP_PX]
        row, column = np.nonzero(np.isfinite(disparity))
        place = STEP_PX * column - np.rint(disparity[row, column]).astype(int)
        row, column, place = (index[place >= 0] for index in (row, column, place))
        here, there = left[STEP_PX * row, STEP_PX * column], right[STEP_PX * row, place]
        usable = (np.minimum(here, there) >= MIN_GREY) & (np.maximum(here, there) <= MAX_GREY)
        if self._gain is None or np.count_nonzero(usable) < MIN_PIXELS:
            return
        ratio = float(np.median(here[usable] / there[usable].astype(np.float64)))
        self._gain = _limited(self._gain * (1.0 + LEARN * (ratio - 1.0)))


def _limited(gain: float) -> float:
    return min(max(gain, GAIN_RANGE[0]), GAIN_RANGE[1])
