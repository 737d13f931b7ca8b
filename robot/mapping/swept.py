"""The floor that the brush has swept: a bar across the robot's centre, drawn along its track."""

from __future__ import annotations

import math

import cv2
import numpy as np

from robot.config import MappingConfig
from robot.geometry.se2 import SE2
from robot.mapping.raster import Window, grown, moved, window_around, window_of
from robot.messages import Grid

_SHIFT = 6  # binary digits of sub-cell precision in cv2's polygon filling


class SweptFloor:
    """Cells of the same lattice as the occupancy grid, swept or not."""

    def __init__(self, config: MappingConfig, brush_width_m: float) -> None:
        self._resolution_m = config.resolution_m
        # Filling paints every cell that the outline touches: half a cell less on each side makes
        # it the cells whose centre was swept.
        self._half_m = max(config.resolution_m / 2.0, (brush_width_m - config.resolution_m) / 2.0)
        self._max_m = config.max_extent_m
        self._window = Window(0, 0, 0, 0)
        self._cells = np.zeros((0, 0), np.uint8)
        self._bar: np.ndarray | None = None
        self._pose: SE2 | None = None

    def sweep(self, world_from_base: SE2) -> None:
        """The brush turned on the way from the previous pose to this one."""
        pose = world_from_base
        if not math.isfinite(pose.x_m + pose.y_m + pose.yaw_rad):
            return
        if self._pose is not None and self._bar is not None:
            moved_m = pose.distance_m(self._pose)
            turned_rad = abs((self._pose.inverse() @ pose).yaw_rad)
            if moved_m < 0.4 * self._resolution_m and turned_rad < 0.1:
                return
        bar = self._bar_at(pose)
        jumped = self._pose is None or pose.distance_m(self._pose) > 4.0 * self._half_m
        self._paint(np.vstack([bar, bar[::-1] if jumped or self._bar is None else self._bar[::-1]]))
        self._pose, self._bar = pose, bar

    def begin_anew(self) -> None:
        """Nothing is swept yet: a new run."""
        self._cells = np.zeros_like(self._cells)
        self.lift()

    def lift(self) -> None:
        """The brush stops: the next pose begins a new track."""
        self._pose = self._bar = None

    def on(self, grid: Grid) -> np.ndarray:
        """Bool array of the grid's shape. The grid must lie on the same lattice."""
        res = self._resolution_m
        if abs(grid.resolution_m - res) > 1e-9:
            raise ValueError(f"grid has cells of {grid.resolution_m} m, swept floor {res} m")
        return moved(self._cells, self._window, window_of(grid)) > 0

    @property
    def area_m2(self) -> float:
        """Area of all swept cells."""
        return float(np.count_nonzero(self._cells)) * self._resolution_m**2

    def _bar_at(self, pose: SE2) -> np.ndarray:
        """Both ends (2, 2) of the brush in `world`."""
        dx, dy = -math.sin(pose.yaw_rad) * self._half_m, math.cos(pose.yaw_rad) * self._half_m
        return np.array([[pose.x_m + dx, pose.y_m + dy], [pose.x_m - dx, pose.y_m - dy]])

    def _paint(self, corners_m: np.ndarray) -> None:
        if np.abs(corners_m).max() > self._max_m:
            return
        res = self._resolution_m
        (x0, y0), (x1, y1) = corners_m.min(axis=0), corners_m.max(axis=0)
        wanted = window_around(x0, y0, x1, y1, res)
        if self._cells.size == 0 or not self._window.contains(wanted):
            new = grown(self._window if self._cells.size else wanted, wanted)
            self._cells, self._window = moved(self._cells, self._window, new), new
        corner = np.array([self._window.ix0, self._window.iy0])
        pixels = (corners_m / res - corner - 0.5) * (1 << _SHIFT)
        hull = cv2.convexHull(np.rint(pixels).astype(np.int32))
        cv2.fillConvexPoly(self._cells, hull, 1, cv2.LINE_8, _SHIFT)
