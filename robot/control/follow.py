"""Follow a track: feed the curvature forward, steer the lateral error away, turn at stops.

Line-of-sight guidance: with a lateral error e the wished heading leans to the path by
atan(e / L), where L is the look-ahead (Fossen, Handbook of Marine Craft Hydrodynamics and Motion
Control, section 12.3). The turn rate is curvature*v plus a gain times the heading error; with gain
k the lateral error obeys e'' + k e' + (k v / L) e = 0, well damped for k L > v.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robot.config import ControlConfig, RobotConfig
from robot.control.limits import clamp
from robot.control.track import make_track
from robot.geometry.se2 import SE2, wrap_angle
from robot.messages import Path

SEARCH_M = 0.4  # progress is looked for this far ahead
JOIN_M = 0.8  # at the beginning, this much of the path may have been passed already
AT_STOP_M = 0.015
CREEP_MPS = 0.04  # the last centimetres before a stop
FACING_RAD = 0.06
TURN_GAIN_PER_S = 5.0


@dataclass(frozen=True, slots=True)
class Steering:
    """Wheel speeds for now; `turning` while standing and turning in place."""

    v_mps: float
    yaw_rate_radps: float
    turning: bool = False


def turn_rate_radps(error_rad: float, robot: RobotConfig, limit_radps: float = math.inf) -> float:
    """Rate for a turn in place that ends softly."""
    return clamp(TURN_GAIN_PER_S * error_rad, min(robot.max_yaw_rate_radps, limit_radps))


class Follower:
    """Drives one path from where the robot is to its end."""

    def __init__(
        self,
        path: Path,
        start: SE2,
        control: ControlConfig,
        robot: RobotConfig,
        cruise_mps: float | None = None,
    ) -> None:
        """`start` is the pose now: what lies behind it on the path is skipped."""
        self._control = control
        self._robot = robot
        speed_mps = min(cruise_mps or robot.cruise_mps, robot.cruise_mps)
        self._track = make_track(path.points_m, control, robot, speed_mps)
        self._turning = False
        self.done = len(self._track) == 0
        self.lateral_m = 0.0  # of the robot, left of the path
        self._i = 0 if self.done else self._join(start)

    @property
    def progress_m(self) -> float:
        """Distance along the track that has been driven or skipped."""
        return self._track.station_m[self._i] if len(self._track) else 0.0

    @property
    def remaining_m(self) -> float:
        """Distance along the track to its end."""
        return self._track.station_m[-1] - self.progress_m if len(self._track) else 0.0

    def ahead(self, distance_m: float, every_m: float = 0.04) -> np.ndarray:
        """Points (n, 2) of the next `distance_m` of the way, for looking whether it is free."""
        track, points = self._track, []
        next_m = self.progress_m
        for k in range(self._i, len(track)):
            if track.station_m[k] > self.progress_m + distance_m:
                break
            if track.station_m[k] >= next_m:
                points.append((track.x_m[k], track.y_m[k]))
                next_m = track.station_m[k] + every_m
        return np.array(points).reshape(-1, 2)

    def steer(self, pose: SE2, aside_m: float = 0.0) -> Steering:
        """Speeds for the pose now, in the frame of the path; `aside_m` to the left of the path."""
        if self.done:
            return Steering(0.0, 0.0)
        self._advance(pose)
        if self._at_stop(pose):
            self._i += 1
            self._turning = True
            if self._i >= len(self._track):
                self._i -= 1
                self.done = True
                return Steering(0.0, 0.0)
        return self._drive(pose, aside_m)

    # ------------------------------------------------------------------ progress

    def _join(self, pose: SE2) -> int:
        """Nearest sample of the beginning; of equally near ones the last that faces our way."""
        track, best, best_cost = self._track, 0, math.inf
        for k in range(len(track)):
            if track.station_m[k] > JOIN_M:
                break
            cost = math.hypot(pose.x_m - track.x_m[k], pose.y_m - track.y_m[k])
            cost += 0.05 * abs(wrap_angle(pose.yaw_rad - track.yaw_rad[k]))
            if cost < best_cost:
                best, best_cost = k, cost
        return best

    def _advance(self, pose: SE2) -> None:
        """Move on to the nearest sample ahead, never past a stop."""
        track, best, best_m = self._track, self._i, math.inf
        for k in range(self._i, len(track)):
            away_m = math.hypot(pose.x_m - track.x_m[k], pose.y_m - track.y_m[k])
            if away_m < best_m:
                best, best_m = k, away_m
            if track.stop[k] or track.station_m[k] > self.progress_m + SEARCH_M:
                break
            if away_m > best_m + 0.06:
                break  # it only gets farther
        self._i = best

    def _at_stop(self, pose: SE2) -> bool:
        track, i = self._track, self._i
        if not track.stop[i]:
            j = min(i + 1, len(track) - 1)
            if not (track.stop[j] and track.station_m[j] - track.station_m[i] < AT_STOP_M):
                return False
            i = j
        along_m = self._along_m(pose, i)
        if along_m > -AT_STOP_M:
            self._i = i
            return True
        return False

    def _along_m(self, pose: SE2, i: int) -> float:
        """How far the robot is past sample `i`, along the path."""
        track = self._track
        c, s = math.cos(track.yaw_rad[i]), math.sin(track.yaw_rad[i])
        return c * (pose.x_m - track.x_m[i]) + s * (pose.y_m - track.y_m[i])

    # ------------------------------------------------------------------ steering

    def _drive(self, pose: SE2, aside_m: float) -> Steering:
        track, control, i = self._track, self._control, self._i
        yaw = track.yaw_rad[i]
        c, s = math.cos(yaw), math.sin(yaw)
        self.lateral_m = -s * (pose.x_m - track.x_m[i]) + c * (pose.y_m - track.y_m[i])
        wished = yaw - math.atan2(self.lateral_m - aside_m, control.lookahead_m)
        error = wrap_angle(wished - pose.yaw_rad)
        if self._turning or abs(error) > control.turn_in_place_rad:
            self._turning = abs(error) > FACING_RAD
            if self._turning:
                return Steering(0.0, turn_rate_radps(error, self._robot), True)
        v = self._speed_mps(pose, i) * max(0.2, math.cos(error)) ** 2
        ahead = self._sample_ahead(i, v * control.drive_lag_s)
        limit = self._robot.max_yaw_rate_radps
        w = track.curvature_radpm[ahead] * v + control.heading_gain_per_s * error
        return Steering(v, clamp(w, limit))

    def _speed_mps(self, pose: SE2, i: int) -> float:
        """Speed of the track a moment ahead, but never less than a creep."""
        track = self._track
        now = track.speed_mps[i]
        soon = track.speed_mps[self._sample_ahead(i, now * self._control.drive_lag_s)]
        return max(CREEP_MPS, min(now, soon))

    def _sample_ahead(self, i: int, distance_m: float) -> int:
        track = self._track
        target_m = track.station_m[i] + distance_m
        while i + 1 < len(track) and not track.stop[i] and track.station_m[i + 1] <= target_m:
            i += 1
        return i
