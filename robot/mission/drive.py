"""Driving one planned path, and noticing that it cannot be driven."""

from __future__ import annotations

import numpy as np

from robot.config import RobotConfig
from robot.control.follow import Follower
from robot.control.wish import Wish, halt
from robot.geometry.se2 import SE2
from robot.messages import Grid, Path
from robot.mission.state import Situation, seconds

BLOCKED_FREE_M = 0.015  # less free way than this is none
BLOCKED_S = 0.4
LOOK_AHEAD_M = 0.7
LOOK_EVERY_S = 0.4
SLACK_M = 0.05  # the map may touch the body by so much before the path counts as blocked
OFF_PATH_M = 0.35
NEXT_M, NEXT_HALF_M = 0.08, 0.12  # it looks so far before its rim whether it has driven there
BACK_ROUND_RADPS = 0.8


class Drive:
    """Follows a path. `blocked` says why it cannot go on, empty while it can."""

    def __init__(self, path: Path, now: Situation, *, cleans: bool) -> None:
        self._follower = Follower(path, now.pose, now.control, now.robot)
        self._cleans = cleans
        across_m = np.linspace(-NEXT_HALF_M, NEXT_HALF_M, 5)
        self._next_m = np.stack([np.full(5, now.robot.radius_m + NEXT_M), across_m], axis=-1)
        self._reason = "sweeping" if cleans else "on the way"
        self._stopped_ns: int | None = None
        self._looked_ns = now.t_ns
        self.blocked = ""

    @property
    def done(self) -> bool:
        """Whether the end of the path has been reached."""
        return self._follower.done

    @property
    def remaining_m(self) -> float:
        """Length of the path still to drive."""
        return self._follower.remaining_m

    @property
    def lateral_m(self) -> float:
        """How far left of the path the robot is."""
        return self._follower.lateral_m

    def tick(self, now: Situation, aside_m: float = 0.0) -> Wish:
        """The wish for this tick: along the path, `aside_m` left of it."""
        steering = self._follower.steer(now.pose, aside_m)
        if abs(self._follower.lateral_m) > OFF_PATH_M:
            self.blocked = "the robot is far from its path"
        self._watch_gate(now, steering.v_mps)
        if seconds(self._looked_ns, now.t_ns) >= LOOK_EVERY_S:
            self._looked_ns = now.t_ns
            ahead = self._follower.ahead(LOOK_AHEAD_M)
            # What is under the robot already is the gate's business: a plan may lead out of it.
            away = np.hypot(ahead[:, 0] - now.pose.x_m, ahead[:, 1] - now.pose.y_m)
            ahead = ahead[away > now.robot.radius_m]
            if meets_matter(ahead, now.view, now.robot.radius_m - SLACK_M):
                self.blocked = "the map shows something on the path"
        if self.blocked:
            return halt(self.blocked)
        v_mps, yaw_rate_radps = steering.v_mps, steering.yaw_rate_radps
        if v_mps > now.config.new_floor_mps and not now.grid.driven(now.pose.apply(self._next_m)):
            v_mps, yaw_rate_radps = slowed(v_mps, yaw_rate_radps, now.config.new_floor_mps)
        brush, fan = now.config.brush, now.config.fan * now.settings.fan_share
        if not self._cleans:
            brush = fan = 0.0
        return Wish(v_mps, yaw_rate_radps, brush, fan, self._reason)

    def _watch_gate(self, now: Situation, v_mps: float) -> None:
        """Something right before the robot for some time blocks the path."""
        if v_mps <= 0.0 or now.gate.verdict.free_m > BLOCKED_FREE_M:
            self._stopped_ns = None
        elif self._stopped_ns is None:
            self._stopped_ns = now.t_ns
        elif seconds(self._stopped_ns, now.t_ns) >= BLOCKED_S:
            self.blocked = "something stands right before the robot"


def slowed(v_mps: float, yaw_rate_radps: float, most_mps: float) -> tuple[float, float]:
    """The same arc at `most_mps`."""
    return most_mps, yaw_rate_radps * most_mps / v_mps


def back_round(robot: RobotConfig, way: float, reason: str) -> Wish:
    """One wheel backs, the robot turns left (`way` 1) or right (-1): out of what its side touches.

    Backing straight would rub along a wall, and nothing else is allowed with the bumper pressed.
    """
    v_mps = -1.1 * BACK_ROUND_RADPS * robot.track_width_m / 2.0
    return Wish(v_mps, way * BACK_ROUND_RADPS, reason=reason)


def meets_matter(points_m: np.ndarray, grid: Grid, radius_m: float) -> bool:
    """Whether an occupied cell's centre lies within `radius_m` of one of the points (n, 2)."""
    if len(points_m) == 0:
        return False
    cells = _occupied(grid, points_m.min(axis=0) - radius_m, points_m.max(axis=0) + radius_m)
    if len(cells) == 0:
        return False
    away = cells[:, None, :] - points_m[None, :, :]
    return bool((away**2).sum(axis=-1).min() < radius_m * radius_m)


def matter_near(grid: Grid, world_from_base: SE2, range_m: float) -> np.ndarray:
    """Centres (n, 2) in `world` of the occupied cells in the square around the robot."""
    here = np.array([world_from_base.x_m, world_from_base.y_m])
    return _occupied(grid, here - range_m, here + range_m)


def _occupied(grid: Grid, low_m: np.ndarray, high_m: np.ndarray) -> np.ndarray:
    res = grid.resolution_m
    origin = np.array([grid.origin_x_m, grid.origin_y_m])
    x0, y0 = np.maximum(np.floor((low_m - origin) / res).astype(int), 0)
    x1, y1 = np.maximum(np.ceil((high_m - origin) / res).astype(int), 0)
    ys, xs = np.nonzero(grid.cells[y0:y1, x0:x1] >= 50)
    return np.stack([xs + x0 + 0.5, ys + y0 + 0.5], axis=-1) * res + origin
