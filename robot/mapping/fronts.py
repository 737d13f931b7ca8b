"""How far into a cell matter reaches: the faces of things, finer than the grid.

Around every near range the cells on its ray learn how far their centre lies behind the face, as a
weighted mean (the truncated signed distance of Curless and Levoy, SIGGRAPH 1996). Up close stereo
is good to millimetres, and a robot that knows a wall to the millimetre can clean along it.
"""

from __future__ import annotations

import cv2
import numpy as np

from robot.geometry.se2 import SE2
from robot.mapping.raster import Window, moved

_REACH_CELLS = 2.0  # farther from a range, a cell learns nothing of it
_OFFSETS = np.arange(-_REACH_CELLS, _REACH_CELLS + 0.1, 0.5)
_PRECISE_M = 0.6  # the weight fades with the fourth power of the range beyond, as 1/sigma^2 does
_FARTHEST_M = 1.5
_LEAST_WEIGHT = 1.0
_RECALLED_WEIGHT = 5.0
_MOST_WEIGHT = 40.0  # bounded, so that what moved is learnt anew


class Fronts:
    """Mean distance of cell centres behind the face of matter, on the grid's lattice."""

    def __init__(self, resolution_m: float) -> None:
        self._res = resolution_m
        self._window = Window(0, 0, 0, 0)
        self._sum_m = np.zeros((0, 0), np.float32)
        self._weight = np.zeros((0, 0), np.float32)

    def follow(self, window: Window) -> None:
        """Cover `window`, which holds the present one."""
        self._sum_m = moved(self._sum_m, self._window, window)
        self._weight = moved(self._weight, self._window, window)
        self._window = window

    def memory(self) -> np.ndarray:
        """Metres (rows, columns, float32) of each cell's centre behind the face, NaN: unknown."""
        known = self._weight >= _LEAST_WEIGHT
        behind_m = self._sum_m / np.maximum(self._weight, _LEAST_WEIGHT)
        return np.where(known, behind_m, np.float32(np.nan)).astype(np.float32)

    def restore(self, window: Window, behind_m: np.ndarray) -> None:
        """Begin with a `memory` of `window`; what is seen now soon outweighs it."""
        self._window = window
        self._weight = np.where(np.isfinite(behind_m), np.float32(_RECALLED_WEIGHT), 0)
        self._weight = self._weight.astype(np.float32)
        self._sum_m = np.nan_to_num(behind_m).astype(np.float32) * self._weight

    def add(self, world_from_eye: SE2, ends_m: np.ndarray) -> None:
        """Where rays ended, (n, 2) in the eye's frame, side by side; NaN: nowhere near.

        Cells outside the window learn nothing.
        """
        if len(ends_m) < 3:
            return
        range_m, straight = np.hypot(*ends_m.T), _straight(ends_m)
        near = (range_m < _FARTHEST_M) & (straight > 0.0)
        if not near.any():
            return
        range_m, straight = range_m[near, None], straight[near, None]
        at_m = world_from_eye.apply(ends_m[near])[:, None, :]
        ray = SE2(yaw_rad=world_from_eye.yaw_rad).apply(ends_m[near] / range_m)[:, None, :]
        cells = np.floor((at_m + _OFFSETS[:, None] * self._res * ray) / self._res).astype(np.int64)
        behind_m = (((cells + 0.5) * self._res - at_m) * ray).sum(axis=2) * straight
        weight = np.minimum(1.0, (_PRECISE_M / range_m) ** 4) * straight**2
        self._learn(cells[..., 0], cells[..., 1], behind_m, np.broadcast_to(weight, behind_m.shape))

    def touch(self, points_m: np.ndarray, inward: np.ndarray) -> None:
        """Points (n, 2) of `world` that lie on a face; `inward` (2,) points into the matter."""
        cells = np.floor(points_m / self._res).astype(np.int64)
        behind_m = ((cells + 0.5) * self._res - points_m) @ inward
        self._learn(cells[:, 0], cells[:, 1], behind_m, np.full(len(cells), _MOST_WEIGHT))

    def _learn(
        self, ix: np.ndarray, iy: np.ndarray, behind_m: np.ndarray, weight: np.ndarray
    ) -> None:
        """Add to the means of the cells at (ix, iy) of the lattice."""
        rows, columns = self._window.shape
        ix, iy = ix - self._window.ix0, iy - self._window.iy0
        inside = (ix >= 0) & (ix < columns) & (iy >= 0) & (iy < rows)
        cells, place = np.unique((iy * columns + ix)[inside], return_inverse=True)
        more = np.bincount(place, weight[inside])
        total = np.bincount(place, (weight * behind_m)[inside])
        sums, known = self._sum_m.reshape(-1), self._weight.reshape(-1)
        keep = np.minimum(1.0, _MOST_WEIGHT / (known[cells] + more))
        sums[cells] = (sums[cells] + total) * keep
        known[cells] = (known[cells] + more) * keep

    def filled(self, occupied: np.ndarray) -> np.ndarray:
        """Percent of each cell (rows, columns) that matter fills; 50 or more where `occupied`.

        Elsewhere it is 0, but for cells beside occupied ones.
        """
        if occupied.size == 0:
            return np.zeros(occupied.shape)
        behind = self.memory()
        known = np.isfinite(behind)
        part = np.clip(50.0 + behind * (100.0 / self._res), 0.0, 100.0)
        beside = cv2.dilate(occupied.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        free = np.where(known & beside, np.minimum(part, 49.0), 0.0)
        return np.where(occupied, np.where(known, np.maximum(part, 50.0), 100.0), free)


def _straight(ends_m: np.ndarray) -> np.ndarray:
    """Cosine (n,) between each ray and the normal of the face that its neighbours show.

    0 for a lone ray, NaN where a neighbour ended nowhere.
    """
    face = np.gradient(ends_m, axis=0)
    across = np.abs(face[:, 0] * ends_m[:, 1] - face[:, 1] * ends_m[:, 0])
    return across / np.maximum(np.hypot(*ends_m.T) * np.hypot(*face.T), 1e-9)
