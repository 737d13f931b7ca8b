"""How much of the floor that could be swept was swept, from true poses.

The brush is a bar across the robot's centre; what it passes over from one pose to the next is the
hull of both bars (steps are short). Cells count as swept when most of their area is.
"""

from __future__ import annotations

from typing import Protocol

import cv2
import numpy as np

_FINER = 4  # each cell is judged by this many squared parts
_SHIFT = 6
_STEP_M = 0.01
_STEP_RAD = 0.05


class Floor(Protocol):
    """A raster of the floor that can be swept (rows = y, columns = x)."""

    @property
    def resolution_m(self) -> float: ...
    @property
    def origin_x_m(self) -> float:
        """Outer corner of cell (0, 0)."""
        ...

    @property
    def origin_y_m(self) -> float: ...
    @property
    def floor(self) -> np.ndarray:
        """Bool (rows, columns)."""
        ...


class Sweep:
    """The raster of what was swept, growing with the track.

    Poses that are not finite are left out. Consecutive poses farther apart than two brush widths
    are a jump (the robot was carried), not a sweep.
    """

    def __init__(self, floor: Floor, brush_width_m: float) -> None:
        self._floor = floor
        self._fine_m = floor.resolution_m / _FINER
        rows, columns = floor.floor.shape
        self._fine = np.zeros((rows * _FINER, columns * _FINER), np.uint8)
        # Filling paints every part that the outline touches: half a part less on each side.
        self._half_m = max(self._fine_m, brush_width_m - self._fine_m) / 2.0
        self._jump_m = 2.0 * brush_width_m
        self._last = np.zeros((0, 3))

    def add(self, track: np.ndarray) -> None:
        """Go on along `track` (n, 4) of t_s, x_m, y_m, yaw_rad."""
        poses = _thinned(np.vstack([self._last, np.asarray(track, float).reshape(-1, 4)[:, 1:]]))
        if len(poses) == 0:
            return
        across = np.stack([-np.sin(poses[:, 2]), np.cos(poses[:, 2])], axis=1) * self._half_m
        origin = np.array([self._floor.origin_x_m, self._floor.origin_y_m])
        ends = np.stack([poses[:, :2] + across, poses[:, :2] - across], axis=1)
        pixels = ((ends - origin) / self._fine_m - 0.5) * (1 << _SHIFT)
        pixels = np.rint(pixels).astype(np.int32)
        far = np.hypot(*np.diff(poses[:, :2], axis=0).T) > self._jump_m
        for i in range(1, len(pixels)):
            if not far[i - 1]:
                hull = cv2.convexHull(pixels[i - 1 : i + 1].reshape(-1, 1, 2))
                cv2.fillConvexPoly(self._fine, hull, 1, cv2.LINE_8, _SHIFT)
        self._last = poses[-1:]

    def mask(self) -> np.ndarray:
        """Bool of the floor's shape: cells most of whose area is swept."""
        rows, columns = self._floor.floor.shape
        parts = self._fine.reshape(rows, _FINER, columns, _FINER).sum(axis=(1, 3), dtype=np.int32)
        return parts * 2 >= _FINER * _FINER

    def covered_pct(self) -> float:
        """Share of the floor that was swept, 0 to 100; NaN if the floor is empty."""
        total = int(np.count_nonzero(self._floor.floor))
        if total == 0:
            return float("nan")
        return 100.0 * int(np.count_nonzero(self.mask() & self._floor.floor)) / total


def swept_mask(floor: Floor, track: np.ndarray, brush_width_m: float) -> np.ndarray:
    """Bool of the floor's shape: swept along the whole `track` (n, 4). See `Sweep`."""
    sweep = Sweep(floor, brush_width_m)
    sweep.add(track)
    return sweep.mask()


def area_m2(floor: Floor) -> float:
    """Area of the floor that can be swept."""
    return int(np.count_nonzero(floor.floor)) * floor.resolution_m**2


def path_ratio(floor: Floor, track: np.ndarray, brush_width_m: float) -> float:
    """Length of the track over (area / brush width): 1 is a brush that never sweeps twice."""
    area = area_m2(floor)
    steps = np.diff(np.asarray(track, float).reshape(-1, 4)[:, 1:3], axis=0)
    return float(np.hypot(*steps.T).sum()) * brush_width_m / area if area > 0.0 else float("nan")


def _thinned(poses: np.ndarray) -> np.ndarray:
    """Finite poses (n, 3) at least a step apart; the first and the last are kept."""
    poses = poses[np.isfinite(poses).all(axis=1)]
    kept = list(range(min(1, len(poses))))
    for i in range(1, len(poses)):
        x, y, yaw = poses[i] - poses[kept[-1]]
        turned = abs((yaw + np.pi) % (2.0 * np.pi) - np.pi)
        if x * x + y * y >= _STEP_M**2 or turned >= _STEP_RAD or i == len(poses) - 1:
            kept.append(i)
    return poses[kept]
