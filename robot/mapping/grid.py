"""The occupancy grid: log-odds over a lattice that grows as the robot sees more.

A stereo range has an error that grows with its square, so a hit is no point but a ramp: free
evidence before the measured range, evidence of matter just behind it, nothing beyond (the idea of
the signed distance of Curless and Levoy, SIGGRAPH 1996, put into log-odds). Summed over scans the
ramps average out, and the front of a wall stands where their sum changes sign: unbiased, however
noisy one range is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robot.config import MappingConfig
from robot.geometry.se2 import SE2
from robot.mapping.fronts import Fronts
from robot.mapping.going import Going
from robot.mapping.raster import Window, grown, moved, window_around, window_of
from robot.messages import Grid, Scan

UNKNOWN = -1
_TOUCHED, _EDGE = 1, 2
_NEAR_M = 0.02  # nearer than this before the eye nothing can be seen
_RIM_M = 0.05  # slack for the pose's error when a touched place is found to be free


@dataclass(frozen=True, slots=True, eq=False)
class GridMemory:
    """A grid to begin with: arrays of (rows, columns), float32, `sticky` uint8 and `driven` bool.

    `sticky` cells were touched (1) or an edge was felt there (2), on `driven` ones the robot has
    stood; `behind_m` is how far a cell's centre lies behind the face of matter, NaN where that is
    unknown, and `lost_pct` (uint8) what wheels lost there by slip.
    Cell (0, 0) has its outer corner at (`ix0`, `iy0`) times `resolution_m` in `world`.
    """

    resolution_m: float
    ix0: int
    iy0: int
    log_odds: np.ndarray
    sticky: np.ndarray
    behind_m: np.ndarray
    driven: np.ndarray
    lost_pct: np.ndarray


class OccupancyGrid:
    """What is free and what is not, in `world`.

    `eye_m` is where the camera stands in `base`: a scan is polar in `base`, but the rays that found
    its ranges began there, and only what they passed was seen to be free.
    """

    def __init__(self, config: MappingConfig, eye_m: tuple[float, float] = (0.13, 0.03)) -> None:
        self._config = config
        self._eye_m = eye_m
        self._window = Window(0, 0, 0, 0)
        self._log_odds = np.zeros((0, 0), np.float32)
        self._sticky = np.zeros((0, 0), np.uint8)
        self._driven = np.zeros((0, 0), bool)
        self._fronts = Fronts(config.resolution_m)
        self._going = Going()
        step_m = config.resolution_m * 0.8
        self._radii_m = np.arange(step_m / 2.0, config.max_range_m, step_m, dtype=np.float32)
        # Evidence fades with the square of the distance, as the precision of stereo does.
        near = np.minimum(1.0, (config.trusted_range_m / self._radii_m) ** 2)
        self._trust = near.astype(np.float32)

    def integrate(self, world_from_base: SE2, scan: Scan) -> None:
        """Add one scan taken from `world_from_base`. Bearings with nothing known add nothing."""
        window, flat, value = self._rays(world_from_base, scan)
        if flat.size == 0 or not self._reserve(window):
            return
        self._fronts.add(world_from_base @ SE2(*self._eye_m), self._ends_m(scan))
        cells = window.shape[0] * window.shape[1]
        count = np.bincount(flat, minlength=cells)
        # In one cell of one scan, matter outweighs the rays that pass beside it: a chair leg is
        # thinner than a cell and must survive.
        value = np.where(value > 0.0, value * np.float32(self._config.hit_over_free), value)
        total = np.bincount(flat, weights=value, minlength=cells)
        change = total / np.maximum(count, 1)
        part = self._log_odds[self._window.slices(window)]
        part += change.reshape(window.shape).astype(np.float32)
        np.clip(part, -self._config.max_free, self._config.max_occupied, out=part)

    def _ends_m(self, scan: Scan) -> np.ndarray:
        """Where the rays ended, (n, 2) in the eye's frame."""
        polar = np.asarray(scan.range_m, float)
        return np.stack([polar * f(scan.bearing_rad) for f in (np.cos, np.sin)], 1) - self._eye_m

    def mark_obstacle(self, points_m: np.ndarray, inward: np.ndarray | None = None) -> None:
        """Points (n, 2) in `world` where something was touched: stays until it is forgotten.

        `inward` (2,) is given where the points lie on its face, and points into it.
        """
        points = _finite(points_m)
        if self._mark(points, _TOUCHED) and inward is not None:
            self._fronts.touch(points, inward)

    def mark_edge(self, points_m: np.ndarray) -> None:
        """Points (n, 2) in `world` where no floor was felt: stays for good, whatever eyes say."""
        self._mark(_finite(points_m), _EDGE)

    def _mark(self, points: np.ndarray, what: int) -> bool:
        """Whether some of the points (n, 2) lie within reason, and were marked."""
        if len(points) == 0:
            return False
        res = self._config.resolution_m
        low, high = points.min(axis=0), points.max(axis=0)
        if not self._reserve(window_around(low[0], low[1], high[0], high[1], res)):
            return False
        x, y = np.floor(points / res).astype(int).T
        at = y - self._window.iy0, x - self._window.ix0
        self._sticky[at] = np.maximum(self._sticky[at], what)
        return True

    def forget_touches(self, world_from_base: SE2, radius_m: float) -> None:
        """Let marks of touches within `radius_m` go where the eyes say that there is floor."""
        res, x, y = self._config.resolution_m, world_from_base.x_m, world_from_base.y_m
        rows, columns = np.nonzero(
            (self._sticky == _TOUCHED) & (self._log_odds <= -self._config.free_below)
        )
        dx = (columns + self._window.ix0 + 0.5) * res - x
        dy = (rows + self._window.iy0 + 0.5) * res - y
        near = np.hypot(dx, dy) <= radius_m
        self._sticky[rows[near], columns[near]] = 0

    def clear_footprint(self, world_from_base: SE2, radius_m: float) -> None:
        """Where the robot stands there is floor; what was touched at its rim stays an obstacle.

        Only a mark well under the robot's body is wiped: nothing can be there.
        """
        window, far_m2 = self._around(world_from_base, radius_m)
        if not self._reserve(window):
            return
        inside = far_m2 <= radius_m**2
        part = self._log_odds[self._window.slices(window)]
        self._sticky[self._window.slices(window)] *= far_m2 > max(0.0, radius_m - _RIM_M) ** 2
        part[inside] = np.minimum(part[inside], -2.0 * self._config.free_below)
        self._driven[self._window.slices(window)] |= inside

    def _around(self, pose: SE2, radius_m: float) -> tuple[Window, np.ndarray]:
        """The cells around a pose, and how far (squared, m2) their centres are from it."""
        res, x, y = self._config.resolution_m, pose.x_m, pose.y_m
        window = window_around(x - radius_m, y - radius_m, x + radius_m, y + radius_m, res)
        dx = (np.arange(window.ix0, window.ix1) + 0.5) * res - x
        dy = (np.arange(window.iy0, window.iy1) + 0.5) * res - y
        return window, dx[None, :] ** 2 + dy[:, None] ** 2

    def driven(self, points_m: np.ndarray) -> bool:
        """Whether the robot has stood on each of the points (n, 2) of `world`, ever."""
        ix, iy = np.floor(points_m / self._config.resolution_m).astype(int).T
        x, y = ix - self._window.ix0, iy - self._window.iy0
        rows, columns = self._driven.shape
        inside = (x >= 0) & (x < columns) & (y >= 0) & (y < rows)
        return bool(inside.all()) and bool(self._driven[y, x].all())

    def feel(self, world_from_base: SE2, radius_m: float, lost: float) -> None:
        """The wheels, within `radius_m`, lost this share (0 to 1) of the way that they rolled."""
        window, far_m2 = self._around(world_from_base, radius_m)
        if self._reserve(window):
            self._going.learn(window, far_m2 <= radius_m**2, lost)

    def lost_pct(self, view: Grid) -> np.ndarray:
        """What wheels lost by slip in the cells of a snapshot: percent, uint8 of its shape."""
        return self._going.on(window_of(view))

    def memory(self) -> GridMemory:
        """Copy what is known, cut to it."""
        rows, columns = (
            np.flatnonzero(((self._log_odds != 0.0) | (self._sticky > 0)).any(axis=a))
            for a in (1, 0)
        )
        if len(rows) == 0:
            none = np.zeros((0, 0), np.float32)
            no, zero = none.astype(bool), none.astype(np.uint8)
            return GridMemory(self._config.resolution_m, 0, 0, none, zero, none, no, zero)
        part = (slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1))
        ix0, iy0 = self._window.ix0 + int(columns[0]), self._window.iy0 + int(rows[0])
        return GridMemory(
            self._config.resolution_m,
            ix0,
            iy0,
            self._log_odds[part].copy(),
            self._sticky[part].copy(),
            self._fronts.memory()[part],
            self._driven[part].copy(),
            self._going.memory(self._window)[part],
        )

    def restore(self, memory: GridMemory) -> None:
        """Begin with `memory`; one of another resolution is not known and leaves nothing."""
        if memory.log_odds.size == 0 or memory.resolution_m != self._config.resolution_m:
            return
        rows, columns = memory.log_odds.shape
        self._window = Window(memory.ix0, memory.iy0, memory.ix0 + columns, memory.iy0 + rows)
        self._log_odds = memory.log_odds.astype(np.float32)
        self._sticky = memory.sticky.astype(np.uint8)
        self._fronts.restore(self._window, memory.behind_m)
        self._driven = memory.driven.astype(bool)
        self._going.restore(self._window, memory.lost_pct)

    def snapshot(self) -> Grid:
        """The grid as a message, cut to what is known (at least one cell)."""
        marked = self._sticky > 0
        known = (self._log_odds <= -self._config.free_below) | marked
        occupied = (self._log_odds >= self._config.occupied_above) | marked
        cells = np.full(known.shape, UNKNOWN, np.int8)
        seen = known | occupied
        cells[seen] = np.rint(self._fronts.filled(occupied)[seen]).astype(np.int8)
        rows = np.flatnonzero((cells != UNKNOWN).any(axis=1))
        columns = np.flatnonzero((cells != UNKNOWN).any(axis=0))
        res = self._config.resolution_m
        if len(rows) == 0:
            return Grid(res, 0.0, 0.0, np.full((1, 1), UNKNOWN, np.int8))
        y0, y1, x0, x1 = rows[0], rows[-1] + 1, columns[0], columns[-1] + 1
        return Grid(
            res,
            (self._window.ix0 + int(x0)) * res,
            (self._window.iy0 + int(y0)) * res,
            np.ascontiguousarray(cells[y0:y1, x0:x1]),
        )

    def _rays(self, pose: SE2, scan: Scan) -> tuple[Window, np.ndarray, np.ndarray]:
        """Cells under all rays: their window, flat index (n,) in it and evidence (n,)."""
        config = self._config
        nothing = (Window(0, 0, 0, 0), np.zeros(0, np.int64), np.zeros(0, np.float32))
        range_m = np.asarray(scan.range_m, float)
        known = np.isfinite(range_m) & (range_m > 0.0)
        clear_m = np.nan_to_num(np.asarray(scan.clear_m, float), nan=0.0, posinf=1e3)
        reach_m = np.where(known, range_m, clear_m)
        bearing = np.asarray(scan.bearing_rad, float)
        ahead = reach_m * np.cos(bearing) - self._eye_m[0]
        aside = reach_m * np.sin(bearing) - self._eye_m[1]
        use = (reach_m > 0.0) & (ahead > _NEAR_M)
        if not use.any() or not math.isfinite(pose.x_m + pose.y_m + pose.yaw_rad):
            return nothing
        ahead, aside, known = ahead[use], aside[use], known[use]
        length_m = np.hypot(ahead, aside)
        # A range beyond the greatest mapped one still says that the way there is free.
        hit = known & (length_m < config.max_range_m)
        sigma_m = np.hypot(config.resolution_m / 2.0, config.range_sigma_per_m2 * length_m**2)
        end_m = np.where(hit, length_m + np.maximum(config.min_thickness_m, sigma_m), length_m)
        front_m, sigma_m, end_m = (
            v.astype(np.float32)[:, None] for v in (length_m, sigma_m, end_m)
        )
        radii = self._radii_m[None, : int(np.searchsorted(self._radii_m, end_m.max()))]
        ramp = np.clip((radii - front_m) / sigma_m, -1.0, 1.0)
        value = np.where(ramp < 0.0, ramp * config.free_weight, ramp * config.hit_weight)
        value *= self._trust[None, : radii.shape[1]]
        eye = pose @ SE2(*self._eye_m)
        res, far = config.resolution_m, float(radii[0, -1])
        window = window_around(eye.x_m - far, eye.y_m - far, eye.x_m + far, eye.y_m + far, res)
        x0, y0 = eye.x_m / res - window.ix0, eye.y_m / res - window.iy0
        angle = eye.yaw_rad + np.arctan2(aside, ahead)
        dx, dy = (np.float32(1.0 / res) * f(angle).astype(np.float32) for f in (np.cos, np.sin))
        ix = (np.float32(x0) + radii * dx[:, None]).astype(np.int32)
        iy = (np.float32(y0) + radii * dy[:, None]).astype(np.int32)
        flat = iy * np.int32(window.shape[1]) + ix
        touched = radii < end_m
        return window, flat[touched], value[touched]

    def _reserve(self, wanted: Window) -> bool:
        """Make room for `wanted`; False (and no change) where it lies absurdly far away."""
        limit = int(self._config.max_extent_m / self._config.resolution_m)
        if max(-wanted.ix0, -wanted.iy0, wanted.ix1, wanted.iy1) > limit:
            return False
        if self._log_odds.size and self._window.contains(wanted):
            return True
        new = grown(self._window if self._log_odds.size else wanted, wanted)
        self._log_odds = moved(self._log_odds, self._window, new)
        self._sticky = moved(self._sticky, self._window, new)
        self._driven = moved(self._driven, self._window, new)
        self._fronts.follow(new)
        self._going.follow(new)
        self._window = new
        return True


def _finite(points_m: np.ndarray) -> np.ndarray:
    """Those of the points (n, 2) that are numbers."""
    points = np.asarray(points_m, dtype=float).reshape(-1, 2)
    return points[np.isfinite(points).all(axis=1)]
