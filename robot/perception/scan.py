"""From disparity to a planar scan: what the robot would bump into, and how far floor is free.

Pixels between the lowest and the highest obstacle height vote in a histogram of column and
disparity (the u-disparity of Hu and Uchimura, IV 2005), where anything upright is a peak. Floor is
followed upwards in every column until something else, or nothing, is seen for too long.
"""

from __future__ import annotations

import math

import numpy as np

from robot.config import PerceptionConfig
from robot.geometry.stereo import StereoCamera
from robot.messages import Scan
from robot.perception.floor import FloorPlane

COLUMN_PX = 2
ROW_PX = 2  # obstacles are looked for in every second row: what matters is taller than a pixel
CELL_PX = 0.5  # of disparity
MIN_EXTENT_M = 0.018  # of an obstacle, above the lowest height that counts
EXTENT_SLOPE, NEAR_M, MAX_EXTENT_M = 0.03, 0.5, 0.05  # ... growing beyond a distance
MIN_ROWS = 6.0
MIN_ABOVE_PX = 0.9  # disparity above the floor's that noise does not reach
FLOOR_PX = 0.8
GAP_M = 0.25  # unseen floor between seen floor that is taken for free ...
GAP_SHARE = 0.15  # ... and more of it far away, where rows are metres apart
CLEAR_STEP_M = 0.05
SPARE_PX = 0.1  # of disparity, against rounding


class ScanMaker:
    """Tables for one camera, and the scan of one frame."""

    def __init__(self, config: PerceptionConfig, camera: StereoCamera) -> None:
        self._config, self._camera = config, camera
        self._u = np.arange(camera.width_px, dtype=np.float32) - np.float32(camera.cx_px)
        self._v = np.arange(camera.height_px, dtype=np.float32) - np.float32(camera.cy_px)
        self._columns = math.ceil(camera.width_px / COLUMN_PX)
        self._column_u = (np.arange(self._columns) + 0.5) * COLUMN_PX - 0.5
        self._cells = math.ceil(config.max_disparity_px / CELL_PX) + 1
        self._min_px = camera.focal_px * camera.baseline_m / config.scan_range_m
        self._bearings = self._spread_bearings()
        self._ray_column, self._ray_z, self._ray_range = self._cast_rays()

    def make(self, disparity_px: np.ndarray, floor: FloorPlane) -> Scan:
        """Scan of one frame from disparity (h, w), NaN where unknown."""
        nearest_px = self._obstacles(disparity_px, floor)
        range_m = self._ranges(nearest_px, floor)
        free_z = self._free_depth(disparity_px, floor)
        fb = self._camera.focal_px * self._camera.baseline_m
        with np.errstate(divide="ignore"):
            free_z = np.minimum(free_z, np.where(nearest_px > 0, fb / nearest_px, np.inf))
        clear_m = self._clear(free_z)
        return Scan(self._bearings, range_m, np.fmin(clear_m, range_m))

    # ------------------------------------------------------------------ obstacles

    def _obstacles(self, disparity_px: np.ndarray, floor: FloorPlane) -> np.ndarray:
        """Disparity (columns,) of the nearest obstacle in every column; 0 where there is none."""
        low = self._config.min_obstacle_m / floor.height_m
        high = self._config.max_obstacle_m / floor.height_m
        # However high and near, a thing that counts hides floor of no less disparity than that.
        top_px = min(0.0, (1.0 - high) * self._config.max_disparity_px)
        rows = self._rows_of_floor(floor, top_px, self._config.max_disparity_px)
        disparity = disparity_px[rows][::ROW_PX]
        above = disparity - _ground(floor, self._u, self._v[rows][::ROW_PX])
        with np.errstate(invalid="ignore"):
            votes = (above > np.float32(low) * disparity) & (above < np.float32(high) * disparity)
            votes &= (above > MIN_ABOVE_PX) & (disparity > self._min_px)
        pixel = np.flatnonzero(votes)
        row = pixel // disparity.shape[1]
        column = (pixel - row * disparity.shape[1]) // COLUMN_PX
        d = disparity.ravel()[pixel]
        cell = np.minimum((d * np.float32(1.0 / CELL_PX)).astype(np.intp), self._cells - 1)
        index = column * self._cells + cell
        shape = (self._columns, self._cells)
        count = np.bincount(index, minlength=shape[0] * shape[1]).reshape(shape)
        total = np.bincount(index, weights=d, minlength=count.size).reshape(shape)
        count, total = _sum_of_three(count), _sum_of_three(total)
        centre = (np.arange(self._cells) + 0.5) * CELL_PX
        enough = (self._rows(row, column, cell) >= self._least_rows(centre)) & (count > 0)
        nearest = self._cells - 1 - np.argmax(enough[:, ::-1], axis=1)
        column = np.arange(self._columns)
        # The first cell over the threshold is the flank of the peak; its top is just behind.
        behind = np.maximum(nearest - 1, 0)
        nearest = np.where(count[column, behind] > count[column, nearest], behind, nearest)
        found = enough.any(axis=1)
        mean = total[column, nearest] / np.maximum(count[column, nearest], 1)
        return np.where(found, mean, 0.0)

    def _least_rows(self, disparity: np.ndarray) -> np.ndarray:
        """Rows that an obstacle must fill; what is low is believed only when it is near.

        Far away a matcher lets the floor climb a little up the foot of a wall.
        """
        z_m = self._camera.focal_px * self._camera.baseline_m / disparity
        extent_m = np.clip(MIN_EXTENT_M + EXTENT_SLOPE * (z_m - NEAR_M), MIN_EXTENT_M, MAX_EXTENT_M)
        return np.maximum(MIN_ROWS, extent_m * disparity / self._camera.baseline_m)

    def _rows(self, row: np.ndarray, column: np.ndarray, cell: np.ndarray) -> np.ndarray:
        """How many image rows voted (columns, cells), neighbours in both counted as one.

        Matching errors run along rows, obstacles stand across them: a streak is one vote. Each
        row is one bit, so that neighbours are joined and rows counted 16 at a time.
        """
        groups = int(row.max(initial=0)) // 16 + 1
        shape = (groups, self._columns + 2, self._cells + 2)
        voted = np.zeros(16 * math.prod(shape), np.uint8)
        place = ((row >> 4) * shape[1] + column + 1) * shape[2] + cell + 1
        voted[(place << 4) + (row & 15)] = 1
        words = np.packbits(voted).view(np.uint16).reshape(shape)
        words = words[:, :-2] | words[:, 1:-1] | words[:, 2:]
        words = words[:, :, :-2] | words[:, :, 1:-1] | words[:, :, 2:]
        return ROW_PX * np.bitwise_count(words).sum(axis=0, dtype=np.uint16)

    def _ranges(self, nearest_px: np.ndarray, floor: FloorPlane) -> np.ndarray:
        """Nearest obstacle (bearings,) in `base`, NaN where none."""
        camera = self._camera
        found = nearest_px > 0
        u, d = self._column_u[found], nearest_px[found]
        middle_m = 0.5 * (self._config.min_obstacle_m + min(self._config.max_obstacle_m, 0.1))
        ground = d * (1.0 - middle_m / floor.height_m)  # under a point of that height
        v = (ground - floor.slope_u * (u - camera.cx_px) - floor.offset_px) / floor.slope_v
        points = camera.base_from_pixel(u, v + camera.cy_px, d)
        distance = np.hypot(points[:, 0], points[:, 1])
        bearing = np.arctan2(points[:, 1], points[:, 0])
        step = self._bearings[1] - self._bearings[0]
        slot = np.rint((bearing - self._bearings[0]) / step).astype(int)
        inside = (slot >= 0) & (slot < len(self._bearings))
        range_m = np.full(len(self._bearings), np.inf)
        np.minimum.at(range_m, slot[inside], distance[inside])
        return np.where(np.isfinite(range_m), range_m, np.nan)

    # ------------------------------------------------------------------ free floor

    def _free_depth(self, disparity_px: np.ndarray, floor: FloorPlane) -> np.ndarray:
        """Depth z (columns,) up to which floor was seen without a long gap; 0: none.

        Far away, where rows are metres apart, every row counts.
        """
        rows = self._rows_of_floor(floor, self._min_px, self._config.max_disparity_px)
        disparity = disparity_px[rows]
        ground = _ground(floor, self._u, self._v[rows])
        tolerance = self._config.min_obstacle_m / floor.height_m
        with np.errstate(invalid="ignore"):
            away = np.abs(disparity - ground)
            flat = (away < np.float32(tolerance) * ground) | (away < FLOOR_PX)
        flat &= (ground > self._min_px) & (ground < self._config.max_disparity_px)
        # Where the foot of a wall passes for floor, its own disparity still tells its depth.
        nearness = np.fmax(disparity, ground) * flat
        pad = self._columns * COLUMN_PX - flat.shape[1]
        nearness = np.pad(nearness, ((0, 0), (0, pad))) if pad else nearness
        nearness = np.maximum(nearness[:, ::COLUMN_PX], nearness[:, COLUMN_PX - 1 :: COLUMN_PX])
        flat = nearness > 0.0
        fb = np.float32(self._camera.focal_px * self._camera.baseline_m)
        first_z = fb / np.float32(self._config.max_disparity_px)  # nearer floor cannot be matched
        depth = fb / np.maximum(nearness, np.float32(1e-3)) * flat
        # Upwards from the bottom row: depth of the last floor seen so far, and the gap since.
        depth, flat = depth[::-1], flat[::-1]
        last = np.maximum.accumulate(np.maximum(depth, first_z), axis=0)
        before = np.vstack([np.full((1, last.shape[1]), first_z, last.dtype), last[:-1]])
        broken = flat & (depth - before > np.maximum(GAP_M, GAP_SHARE * depth))
        whole = ~np.logical_or.accumulate(broken, axis=0)
        return np.max(depth * whole, axis=0)

    def _clear(self, free_z: np.ndarray) -> np.ndarray:
        """Free floor (bearings,) along every ray from `base`, from depth (columns,).

        The part of a ray before the camera's sight counts as free only if what follows was seen.
        """
        free = self._ray_z <= free_z[self._ray_column]
        open_so_far = np.logical_and.accumulate(free, axis=1)
        seen = np.any(open_so_far & (self._ray_z > 0.0), axis=1)
        return np.where(seen, np.max(np.where(open_so_far, self._ray_range, 0.0), axis=1), 0.0)

    def _rows_of_floor(self, floor: FloorPlane, low_px: float, high_px: float) -> slice:
        """Where the floor's disparity can lie between two values; begins with an even row."""
        aside_px = abs(floor.slope_u) * float(np.abs(self._u[[0, -1]]).max()) + SPARE_PX
        ends_px = np.array([low_px - aside_px, high_px + aside_px]) - floor.offset_px
        low, high = ends_px / max(floor.slope_v, 1e-6) + self._camera.cy_px
        first = min(max(math.floor(low), 0), len(self._v) - 1) // ROW_PX * ROW_PX
        return slice(first, min(max(math.ceil(high) + 1, first + 1), len(self._v)))

    # ------------------------------------------------------------------ tables

    def _spread_bearings(self) -> np.ndarray:
        camera = self._camera
        edge = np.array([camera.width_px - 1.0, 0.0])
        far = camera.base_from_pixel(edge, np.full(2, camera.cy_px), np.full(2, self._min_px))
        ends = np.arctan2(far[:, 1], far[:, 0])
        return np.linspace(ends[0], ends[1], self._config.scan_bearings)

    def _cast_rays(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Column and depth of floor points along every bearing, (bearings, steps); range (steps,).

        Points before the camera's sight begins are taken for clear: their depth is -1.
        """
        steps = np.arange(CLEAR_STEP_M, self._config.scan_range_m + 1e-9, CLEAR_STEP_M)
        x = np.cos(self._bearings)[:, None] * steps
        y = np.sin(self._bearings)[:, None] * steps
        u, v, d = self._camera.pixel_from_base(np.stack([x, y, np.zeros_like(x)], axis=-1))
        z = self._camera.focal_px * self._camera.baseline_m / d
        matched = d <= self._config.max_disparity_px
        before = np.isnan(d) | ~matched | (v > self._camera.height_px - 1)
        beside = ~before & ((u < 0) | (u > self._camera.width_px - 1))
        column = np.clip(np.nan_to_num(u), 0, self._camera.width_px - 1).astype(int) // COLUMN_PX
        z = np.where(beside, np.inf, np.where(before, -1.0, z))
        # A ray that leaves the near blind zone beside the view starts where it enters the view.
        entered = np.logical_or.accumulate(~before & ~beside, axis=1)
        z = np.where(beside & ~entered, -1.0, z)
        return column, z, steps


def _ground(floor: FloorPlane, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Disparity (rows, columns) of the floor, for places relative to the principal point."""
    rows = np.float32(floor.slope_v) * v + np.float32(floor.offset_px)
    return rows[:, None] + np.float32(floor.slope_u) * u


def _sum_of_three(values: np.ndarray) -> np.ndarray:
    """Every value of (n, m) plus its two neighbours along the second axis."""
    total = values.copy()
    total[:, 1:] += values[:, :-1]
    total[:, :-1] += values[:, 1:]
    return total
