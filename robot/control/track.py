"""A path made drivable: corners rounded where that is harmless, else marked as stops, with speeds.

A corner of angle t rounded with radius R starts R*tan(t/2) before its vertex and cuts it by
R*(1/cos(t/2) - 1). Two neighbouring lanes are joined by two corners to the same side with a short
link between: inside such a hairpin lies floor that the robot drives over anyway, so there the cut
may be as large as the link allows; every other corner may be cut by little only, because planners
lead paths close round obstacles.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from robot.config import ControlConfig, RobotConfig
from robot.geometry.se2 import wrap_angle

SPACING_M = 0.02
ARC_SPACING_M = 0.01
SAME_POINT_M = 0.004
SHARP_RAD = 0.35  # a corner of at least this angle that cannot be rounded is a stop
MIN_RADIUS_M = 0.05  # a tighter arc is slower than turning in place
HAIRPIN_M = 0.35  # longest link between lanes
TURN_SHARE = 0.85  # of the turn rate is used by arcs, the rest corrects


@dataclass(frozen=True, slots=True)
class Track:
    """Samples along the way, as lists (fast to read one by one).

    `speed_mps` is the highest speed at a sample so that every later one can be kept; a sample with
    `stop` ends a stretch: the robot stands there and turns to the next sample's heading.
    """

    x_m: list[float]
    y_m: list[float]
    yaw_rad: list[float]
    curvature_radpm: list[float]
    speed_mps: list[float]
    stop: list[bool]
    station_m: list[float]

    def __len__(self) -> int:
        return len(self.x_m)


class _Builder:
    def __init__(self) -> None:
        self.x: list[float] = []
        self.y: list[float] = []
        self.yaw: list[float] = []
        self.curvature: list[float] = []
        self.stop: list[bool] = []

    def add(self, x: float, y: float, yaw: float, curvature: float) -> None:
        self.x.append(x)
        self.y.append(y)
        self.yaw.append(yaw)
        self.curvature.append(curvature)
        self.stop.append(False)

    def line(self, x0: float, y0: float, x1: float, y1: float, yaw: float) -> None:
        n = max(1, math.ceil(math.hypot(x1 - x0, y1 - y0) / SPACING_M))
        for k in range(n + 1):
            self.add(x0 + (x1 - x0) * k / n, y0 + (y1 - y0) * k / n, yaw, 0.0)

    def arc(self, x: float, y: float, yaw: float, turn: float, radius: float) -> None:
        """Inner samples of an arc that begins at (x, y) with heading `yaw`."""
        sign = math.copysign(1.0, turn)
        cx, cy = x - sign * radius * math.sin(yaw), y + sign * radius * math.cos(yaw)
        n = max(2, math.ceil(radius * abs(turn) / ARC_SPACING_M))
        for k in range(1, n):
            a = yaw + turn * k / n
            self.add(
                cx + sign * radius * math.sin(a),
                cy - sign * radius * math.cos(a),
                wrap_angle(a),
                sign / radius,
            )


def make_track(
    points_m: np.ndarray, control: ControlConfig, robot: RobotConfig, cruise_mps: float
) -> Track:
    """Sample the polyline `points_m` (n, 2). Fewer than two distinct points give an empty track."""
    points = _distinct(points_m)
    if len(points) < 2:
        return Track([], [], [], [], [], [], [])
    steps = [(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(points)]
    length = [math.hypot(*step) for step in steps]
    yaw = [math.atan2(step[1], step[0]) for step in steps]
    turn = [wrap_angle(b - a) for a, b in pairwise(yaw)]
    build = _Builder()
    cut_m = 0.0  # of the segment's beginning, taken by the arc before
    for i, (a, b) in enumerate(pairwise(points)):
        c, s = math.cos(yaw[i]), math.sin(yaw[i])
        last = i == len(turn)
        radius = 0.0 if last else _radius_m(i, turn, length, control)
        tangent = 0.0 if last else radius * math.tan(abs(turn[i]) / 2.0)
        x1, y1 = b[0] - c * tangent, b[1] - s * tangent
        build.line(a[0] + c * cut_m, a[1] + s * cut_m, x1, y1, yaw[i])
        if radius > 0.0:
            build.arc(x1, y1, yaw[i], turn[i], radius)
        elif last or abs(turn[i]) >= SHARP_RAD:
            build.stop[-1] = True
        cut_m = tangent
    return _with_speeds(build, control, robot, cruise_mps)


def _distinct(points_m: np.ndarray) -> list[tuple[float, float]]:
    points: list[tuple[float, float]] = []
    for x, y in np.asarray(points_m, dtype=float).reshape(-1, 2).tolist():
        if not points or math.hypot(x - points[-1][0], y - points[-1][1]) > SAME_POINT_M:
            points.append((x, y))
    return points


def _radius_m(i: int, turn: list[float], length: list[float], control: ControlConfig) -> float:
    """Radius for the corner after segment `i`, 0 when it is driven as a point."""
    half = abs(turn[i]) / 2.0
    if half < 1e-3 or half > 0.45 * math.pi:
        return 0.0
    room_m = 0.5 * min(length[i], length[i + 1])
    cut_limit = control.corner_cut_m / (1.0 / math.cos(half) - 1.0)
    # A hairpin's arcs must fit the link between its lanes; a slight bend may be as wide as it can.
    limit = control.corner_radius_m if _in_hairpin(i, turn, length) else cut_limit
    radius = min(room_m / math.tan(half), limit)
    return radius if radius >= MIN_RADIUS_M else 0.0


def _in_hairpin(i: int, turn: list[float], length: list[float]) -> bool:
    """Whether corner `i` and a neighbour turn the same way by about half a turn together."""
    for first, link in ((i - 1, i), (i, i + 1)):
        if first >= 0 and first + 1 < len(turn) and length[link] <= HAIRPIN_M:
            both = turn[first] + turn[first + 1]
            same_way = turn[first] * turn[first + 1] > 0.0
            if same_way and abs(both) > 0.8 * math.pi:
                return True
    return False


def _with_speeds(
    build: _Builder, control: ControlConfig, robot: RobotConfig, cruise_mps: float
) -> Track:
    x, y = np.array(build.x), np.array(build.y)
    step = np.hypot(np.diff(x), np.diff(y))
    station = np.concatenate([[0.0], np.cumsum(step)])
    gaps: list[float] = step.tolist()
    turn_radps = TURN_SHARE * robot.max_yaw_rate_radps
    speed = [
        0.0 if stop else min(cruise_mps, turn_radps / max(abs(k), 1e-9))
        for k, stop in zip(build.curvature, build.stop, strict=True)
    ]
    for i in range(len(speed) - 2, -1, -1):  # brake in time for whatever comes
        reachable = math.sqrt(speed[i + 1] ** 2 + 2.0 * control.brake_mps2 * gaps[i])
        speed[i] = min(speed[i], reachable)
    return Track(build.x, build.y, build.yaw, build.curvature, speed, build.stop, station.tolist())
