"""Speeds and accelerations that the drive can follow."""

from __future__ import annotations

import math
from dataclasses import dataclass

from robot.config import ControlConfig, RobotConfig

MAX_STEP_S = 0.1  # a late tick must not allow a leap


def clamp(value: float, limit: float) -> float:
    """`value` within [-limit, limit]."""
    return max(-limit, min(limit, value))


def braking_speed_mps(free_m: float, brake_mps2: float, reaction_s: float = 0.0) -> float:
    """Largest v with v*t + v^2/(2a) <= free: the robot stops within what it sees.

    `free_m` below 0 counts as 0; t is `reaction_s` and a is `brake_mps2`.
    """
    lag_mps = brake_mps2 * reaction_s
    return math.sqrt(lag_mps * lag_mps + 2.0 * brake_mps2 * max(0.0, free_m)) - lag_mps


def stopping_distance_m(v_mps: float, brake_mps2: float, reaction_s: float = 0.0) -> float:
    """Distance until standing: the inverse of `braking_speed_mps`."""
    return abs(v_mps) * reaction_s + v_mps * v_mps / (2.0 * brake_mps2)


@dataclass(slots=True)
class Ramp:
    """Holds the last ordered speeds and limits how fast they change.

    Losing speed may be quicker than gaining it, never slower: a hard stop is the caller's right.
    """

    control: ControlConfig
    robot: RobotConfig
    v_mps: float = 0.0
    yaw_rate_radps: float = 0.0

    def step(self, v_mps: float, yaw_rate_radps: float, dt_s: float) -> tuple[float, float]:
        """Move towards the wished speeds for `dt_s`; returns (v_mps, yaw_rate_radps).

        The result stays within cruise speed and the highest turn rate. NaN counts as 0.
        """
        dt_s = max(0.0, min(dt_s, MAX_STEP_S))
        v = 0.0 if math.isnan(v_mps) else clamp(v_mps, self.robot.cruise_mps)
        w = 0.0 if math.isnan(yaw_rate_radps) else yaw_rate_radps
        w = clamp(w, self.robot.max_yaw_rate_radps)
        gain = self.control.acceleration_mps2 * dt_s
        loss = 2.0 * self.control.brake_mps2 * dt_s
        self.v_mps = _approach(self.v_mps, v, gain, loss)
        turn = self.control.yaw_acceleration_radps2 * dt_s
        self.yaw_rate_radps += clamp(w - self.yaw_rate_radps, turn)
        return self.v_mps, self.yaw_rate_radps

    def force(self, v_mps: float, yaw_rate_radps: float) -> None:
        """Take over what was really ordered after a stricter rule."""
        self.v_mps, self.yaw_rate_radps = v_mps, yaw_rate_radps


def _approach(now: float, wish: float, gain: float, loss: float) -> float:
    """Step from `now` to `wish`: by `gain` away from zero, by `loss` towards it."""
    if now * wish < 0.0:
        wish = 0.0  # through a standstill first
    if abs(wish) >= abs(now):
        return now + clamp(wish - now, gain)
    return now + clamp(wish - now, loss)
