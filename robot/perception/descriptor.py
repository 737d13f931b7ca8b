"""What a place looks like: 256 comparisons inside a patch of fixed size in metres.

BRIEF (Calonder et al., ECCV 2010) with two changes that a robot on a floor allows: the patch is
scaled by the point's depth, so that coming nearer changes nothing, and never rotated.
"""

from __future__ import annotations

import cv2
import numpy as np

BITS = 256
GRID = 16
LEVELS = 4
_SEED = 20
_SPREAD = 4.0  # of the second sample around the first, in grid cells


def _pairs() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(_SEED)
    first = rng.integers(0, GRID, (BITS, 2))
    away = np.rint(rng.normal(0.0, _SPREAD, (BITS, 2))).astype(int)
    away[np.all(away == 0, axis=1)] = [0, 1]
    second = np.clip(first + away, 0, GRID - 1)
    same = np.all(first == second, axis=1)
    second[same] = GRID - 1 - first[same]
    return first @ [GRID, 1], second @ [GRID, 1]


_FIRST, _SECOND = _pairs()
_OFFSET = np.arange(GRID) - (GRID - 1) / 2.0


class Describer:
    """Cuts patches out of a pyramid of one image."""

    def __init__(self, image: np.ndarray) -> None:
        """`image` is a smoothed grey image (h, w)."""
        self._levels = [image]
        for _ in range(LEVELS - 1):
            self._levels.append(cv2.pyrDown(self._levels[-1]))

    def describe(self, pixel: np.ndarray, width_px: np.ndarray) -> np.ndarray:
        """Descriptors (n, 32) uint8 of square patches `width_px` (n,) wide around pixels (n, 2)."""
        if not len(pixel):
            return np.empty((0, BITS // 8), np.uint8)
        step = width_px / GRID
        level = np.clip(np.floor(np.log2(np.maximum(step, 1e-3)) + 0.3), 0, LEVELS - 1).astype(int)
        patches = np.zeros((len(pixel), GRID, GRID), np.uint8)
        for number, image in enumerate(self._levels):
            chosen = np.flatnonzero(level == number)
            if len(chosen):
                patches[chosen] = _cut(image, pixel[chosen], step[chosen], 2.0**number)
        flat = cv2.blur(patches.reshape(-1, GRID), (3, 1)).reshape(-1, GRID * GRID)
        return np.packbits(flat[:, _FIRST] < flat[:, _SECOND], axis=1)

    def inside(self, pixel: np.ndarray, width_px: np.ndarray, share: float) -> np.ndarray:
        """Whether (n,) at least `share` of each patch lies in the image, along both axes."""
        height, width = self._levels[0].shape
        limit = np.array([width, height], float)
        half = 0.5 * width_px[:, None]
        seen = np.minimum(pixel + half, limit) - np.maximum(pixel - half, 0.0)
        return np.all(seen >= share * width_px[:, None], axis=1)


def _cut(image: np.ndarray, pixel: np.ndarray, step: np.ndarray, scale: float) -> np.ndarray:
    """Patches (n, GRID, GRID) sampled around pixels of level 0 from a level `scale` smaller."""
    x = (pixel[:, 0, None] + _OFFSET * step[:, None]) / scale
    y = (pixel[:, 1, None] + _OFFSET * step[:, None]) / scale
    shape = (len(pixel), GRID, GRID)
    map_x = np.broadcast_to(x[:, None, :], shape).reshape(-1, GRID).astype(np.float32)
    map_y = np.broadcast_to(y[:, :, None], shape).reshape(-1, GRID).astype(np.float32)
    cut = cv2.remap(image, map_x, map_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return cut.reshape(shape)
