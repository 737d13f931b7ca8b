"""What the last scans showed around the robot, kept in the odometry frame.

The camera cannot see the floor right before the wheels, nor beside itself after a turn, so the gate
must remember. A point is forgotten when a newer scan sees floor where it was, when it is old, or
when it is far. Free space is remembered as the scans themselves. What the map knows about the
neighbourhood is added as points of their own: it remembers longer, and can only slow the robot.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections import deque
from dataclasses import dataclass

import numpy as np

from robot.config import ControlConfig, RobotConfig
from robot.geometry.se2 import SE2
from robot.messages import Scan

VIEW_EVERY_NS = 200_000_000  # two views closer in time than this say the same
NEAR_M = 0.7
SQUARE_M = 0.015
REFUTE_M = 0.08  # floor must be seen this far behind a point to forget it
WITNESSES = 3  # so many points make an obstacle, fewer are noise
BESIDE_M, BESIDE_BACK_M, BESIDE_AHEAD_M = 0.06, 0.05, 0.18
BESIDE_BEFORE_M = 0.03  # what reaches farther into the robot's way stands before it
STRAIGHT_RADPM = 1e-3  # a smaller curvature is a straight line


@dataclass(frozen=True, slots=True)
class Corridor:
    """What lies ahead on the arc that the robot is about to drive.

    `free_m` until the robot's body touches something, `graze_m` the same for a body that is wider
    by a margin; both infinite when nothing is known there.
    """

    free_m: float
    graze_m: float


class _View:
    """Free space of one scan: how far the floor was seen clear on each bearing."""

    __slots__ = ("base_from_odom", "bearings", "clear", "half_step", "t_ns")

    def __init__(self, t_ns: int, odom_from_base: SE2, scan: Scan) -> None:
        self.t_ns = t_ns
        self.base_from_odom = odom_from_base.inverse()
        self.bearings: list[float] = scan.bearing_rad.tolist()
        self.clear: list[float] = scan.clear_m.tolist()
        n = len(self.bearings)
        self.half_step = (self.bearings[-1] - self.bearings[0]) / max(n - 1, 1) if n else 0.0

    def covers(self, x_m: float, y_m: float) -> bool:
        """Whether the floor at a point of `odom` was seen free."""
        pose = self.base_from_odom
        c, s = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
        bx = pose.x_m + c * x_m - s * y_m
        by = pose.y_m + s * x_m + c * y_m
        bearing = math.atan2(by, bx)
        i = bisect_left(self.bearings, bearing)
        near = [k for k in (i - 1, i) if 0 <= k < len(self.bearings)]
        if not near:
            return False
        k = min(near, key=lambda j: abs(self.bearings[j] - bearing))
        if abs(self.bearings[k] - bearing) > self.half_step:
            return False
        return math.hypot(bx, by) <= self.clear[k]


class Sight:
    """Short memory of obstacles and free floor around the robot."""

    def __init__(self, control: ControlConfig, robot: RobotConfig) -> None:
        self._control = control
        self._robot = robot
        self._points_m = np.empty((0, 2))  # in odom
        self._stamps_ns = np.empty(0, dtype=np.int64)
        self._mapped_m = np.empty((0, 2))  # in odom
        self._near_m = np.empty((0, 2))  # those of `_points_m` that matter until the next scan
        self._views: deque[_View] = deque()

    def forget(self) -> None:
        """Drop all: the robot was carried away from what it saw."""
        self._points_m = self._mapped_m = self._near_m = np.empty((0, 2))
        self._stamps_ns = np.empty(0, dtype=np.int64)
        self._views.clear()

    def know(self, points_m: np.ndarray) -> None:
        """Take obstacles (n, 2) of `odom` near the robot from the map, instead of the last ones."""
        self._mapped_m = points_m

    def see(self, t_ns: int, odom_from_base: SE2, scan: Scan) -> None:
        """Take in a scan with the odometry pose at the time of its frame."""
        keep_ns = t_ns - int(self._control.memory_s * 1e9)
        self._forget(keep_ns, odom_from_base, scan)
        near = np.isfinite(scan.range_m) & (scan.range_m <= self._control.memory_range_m)
        r, b = scan.range_m[near], scan.bearing_rad[near]
        fresh = odom_from_base.apply(np.stack([r * np.cos(b), r * np.sin(b)], axis=-1))
        self._points_m = np.concatenate([self._points_m, fresh])
        stamps = np.full(len(fresh), t_ns, dtype=np.int64)
        self._stamps_ns = np.concatenate([self._stamps_ns, stamps])
        self._thin()
        here = np.array([odom_from_base.x_m, odom_from_base.y_m])
        self._near_m = self._points_m[(np.abs(self._points_m - here) < NEAR_M).all(axis=1)]
        free_ns = t_ns - int(self._control.free_memory_s * 1e9)
        while self._views and self._views[0].t_ns < free_ns:
            self._views.popleft()
        if len(self._views) > 1 and self._views[-1].t_ns - self._views[-2].t_ns < VIEW_EVERY_NS:
            self._views.pop()
        self._views.append(_View(t_ns, odom_from_base, scan))

    def _thin(self) -> None:
        """Keep the newest point of each small square."""
        square = np.floor(self._points_m / SQUARE_M).astype(np.int64)
        key = square[:, 0] * (1 << 32) + square[:, 1]
        _, last = np.unique(key[::-1], return_index=True)
        keep = np.sort(len(key) - 1 - last)
        self._points_m, self._stamps_ns = self._points_m[keep], self._stamps_ns[keep]

    def _forget(self, keep_ns: int, odom_from_base: SE2, scan: Scan) -> None:
        points = odom_from_base.inverse().apply(self._points_m)
        range_m = np.hypot(points[:, 0], points[:, 1])
        keep = (self._stamps_ns >= keep_ns) & (range_m <= self._control.memory_range_m)
        if len(scan.bearing_rad) > 1 and len(points):
            bearing = np.arctan2(points[:, 1], points[:, 0])
            after = np.searchsorted(scan.bearing_rad, bearing)
            inside = (after > 0) & (after < len(scan.bearing_rad))
            after = after.clip(1, len(scan.bearing_rad) - 1)
            # Both rays beside the point must pass it, or edges would wear away.
            clear = np.minimum(scan.clear_m[after - 1], scan.clear_m[after])
            keep &= ~(inside & (range_m + REFUTE_M < clear))
        self._points_m, self._stamps_ns = self._points_m[keep], self._stamps_ns[keep]

    def corridor(self, odom_from_base: SE2, direction: int, curvature_radpm: float) -> Corridor:
        """Free distance along the arc that starts at the robot.

        `direction` is +1 ahead, -1 backwards; `curvature_radpm` is yaw rate over speed, so positive
        turns left when driving ahead. One page of geometry: a disc of radius r whose centre moves
        on a circle of radius R about C touches a point at distance d from C where
        cos(angle) = (R^2 + d^2 - r^2) / (2 R d)  (law of cosines).
        """
        curvature = curvature_radpm * direction
        graze_m, body_m = math.inf, math.inf
        base_from_odom = odom_from_base.inverse()
        for memory, witnesses in ((self._near_m, WITNESSES), (self._mapped_m, 1)):
            if len(memory) < witnesses:
                continue
            points = base_from_odom.apply(memory)
            x, y = points[:, 0] * direction, points[:, 1]
            wide = self._robot.radius_m + self._control.graze_m
            touch_m = free_on_arc_m(x, y, curvature, wide, witnesses)
            graze_m = min(graze_m, touch_m)
            if math.isfinite(touch_m):
                # Slim at the sides, where it only grazes, but not in front.
                slim = self._robot.radius_m - self._control.graze_m
                slim_m = free_on_arc_m(x, y, curvature, slim, witnesses) - self._control.graze_m
                body_m = min(body_m, max(0.0, slim_m))
        return Corridor(body_m, graze_m)

    def rooms_beside_m(self, odom_from_base: SE2, *, mapped: bool = False) -> tuple[float, float]:
        """From the robot's flanks to what stands at its left and at its right; NaN: nothing near.

        Of what has just been seen; with `mapped` else of what the map knows, which may be a cliff.
        What is a little ahead counts, as the robot will be there soon.
        """
        rooms_m = [math.nan, math.nan]
        known = ((self._near_m, WITNESSES), (self._mapped_m, 1))
        for memory, witnesses in known if mapped else known[:1]:
            points = odom_from_base.inverse().apply(memory)
            beside = points[(points[:, 0] > -BESIDE_BACK_M) & (points[:, 0] < BESIDE_AHEAD_M), 1]
            for i, away_m in enumerate((beside, -beside)):
                if math.isnan(rooms_m[i]):
                    rooms_m[i] = self._least_room_m(away_m, witnesses)
        return rooms_m[0], rooms_m[1]

    def _least_room_m(self, away_m: np.ndarray, witnesses: int) -> float:
        """Of points so far to one side (n,); what reaches into the way stands before the robot."""
        room_m = away_m - self._robot.radius_m
        room_m = room_m[(room_m > -BESIDE_BEFORE_M) & (room_m < BESIDE_M)]
        if len(room_m) < witnesses:
            return math.nan
        return float(np.partition(room_m, witnesses - 1)[witnesses - 1])

    def nearest_ahead_m(self, odom_from_base: SE2, free_m: float, direction: int) -> np.ndarray:
        """Points (n, 2) of `odom` that the robot would touch within `free_m` straight on."""
        points = odom_from_base.inverse().apply(self._points_m)
        x, y = points[:, 0] * direction, points[:, 1]
        r = self._robot.radius_m
        hit = (np.abs(y) < r) & (x > 0.0)
        reach = np.full(len(x), np.inf)
        reach[hit] = x[hit] - np.sqrt(r * r - y[hit] ** 2)
        return self._points_m[reach <= free_m]

    def knows_free(self, odom_from_base: SE2, ahead_m: float) -> bool:
        """Whether the floor `ahead_m` before the robot's front was seen free, on three lines."""
        reach = self._robot.radius_m + ahead_m
        half = 0.5 * self._robot.radius_m
        c, s = math.cos(odom_from_base.yaw_rad), math.sin(odom_from_base.yaw_rad)
        x0, y0 = odom_from_base.x_m + c * reach, odom_from_base.y_m + s * reach
        return all(self._seen_free(x0 - s * y, y0 + c * y) for y in (0.0, half, -half))

    def _seen_free(self, x_m: float, y_m: float) -> bool:
        return any(view.covers(x_m, y_m) for view in reversed(self._views))


def free_on_arc_m(
    x: np.ndarray, y: np.ndarray, curvature_radpm: float, r: float, witnesses: int
) -> float:
    """Distance along the arc at which so many points touch a disc of radius `r`."""
    if abs(curvature_radpm) < STRAIGHT_RADPM:
        hit = (np.abs(y) < r) & (x > 0.0)
        free = x[hit] - np.sqrt(r * r - y[hit] ** 2)
    else:
        radius = 1.0 / abs(curvature_radpm)
        side = y if curvature_radpm > 0 else -y  # now the centre C lies at (0, radius)
        d = np.hypot(x, side - radius)
        phase = np.arctan2(x, radius - side)
        with np.errstate(divide="ignore", invalid="ignore"):
            cosine = (radius * radius + d * d - r * r) / (2.0 * radius * d)
        hit = (np.abs(cosine) <= 1.0) & (phase > 0.0)
        free = radius * (phase[hit] - np.arccos(cosine[hit]))
    if len(free) < witnesses:
        return math.inf
    return max(0.0, float(np.partition(free, witnesses - 1)[witnesses - 1]))
