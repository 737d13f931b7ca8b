"""Lines that the footprint must never cross, near the robot and in the odometry frame.

Unlike an obstacle, which may be touched slowly, a line is stopped before. A robot that reaches over
one already, by the error of its place or because somebody put it there, may move away from it only.
"""

from __future__ import annotations

import math

import numpy as np

from robot.config import ControlConfig, RobotConfig
from robot.control.sight import free_on_arc_m
from robot.geometry.se2 import SE2

EVERY_M = 0.015
NEAR_M = 1.0  # farther lines do not matter within a second


class KeepOut:
    """What is forbidden around the robot."""

    def __init__(self, control: ControlConfig, robot: RobotConfig) -> None:
        self._reach_m = robot.radius_m + control.no_go_margin_m
        self._points_m = np.empty((0, 2))  # in odom

    def know(self, lines_m: np.ndarray, odom_from_base: SE2) -> None:
        """Take the lines (n, 4) of `odom`: x, y of the start, x, y of the end; instead of the last.

        Only what is near the robot is kept, as points.
        """
        if len(lines_m) == 0:
            self._points_m = np.empty((0, 2))
            return
        here = np.array([odom_from_base.x_m, odom_from_base.y_m])
        points = [_points(line, here) for line in np.asarray(lines_m, float)]
        self._points_m = np.concatenate(points)

    def free_m(self, odom_from_base: SE2, direction: int, curvature_radpm: float) -> float:
        """Distance along the arc until the footprint and its margin meet a line; see `Sight`."""
        if len(self._points_m) == 0:
            return math.inf
        at = odom_from_base.inverse().apply(self._points_m)
        x, y = at[:, 0] * direction, at[:, 1]
        return free_on_arc_m(x, y, curvature_radpm * direction, self._reach_m, 1)


def _points(line: np.ndarray, here: np.ndarray) -> np.ndarray:
    """Points (n, 2) along the part of a line that is near."""
    start, end = line[:2], line[2:]
    along = end - start
    length_m = float(np.hypot(*along))
    if length_m < 1e-9:
        return start[None] if np.hypot(*(start - here)) < NEAR_M else np.empty((0, 2))
    middle = float((here - start) @ along) / length_m
    aside = abs(float(along[0] * (here - start)[1] - along[1] * (here - start)[0])) / length_m
    if aside >= NEAR_M:
        return np.empty((0, 2))
    half = math.sqrt(NEAR_M * NEAR_M - aside * aside)
    low, high = max(0.0, middle - half), min(length_m, middle + half)
    if high < low:
        return np.empty((0, 2))
    s = np.linspace(low, high, max(2, math.ceil((high - low) / EVERY_M) + 1))
    points: np.ndarray = start + np.outer(s / length_m, along)
    return points
