"""Motion between two frames from whatever feels it, with slip and standstill recognised.

A wheel that spins rolls further than the floor passes: where the wheels' turn contradicts the
gyro's, the wheel that ran ahead is replaced by what gyro and the other wheel say.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from robot.config import RobotConfig, SlamConfig
from robot.geometry.se2 import SE2
from robot.messages import VisualMotion
from robot.slam.history import Mark, OdometryBuffer
from robot.slam.motion import (
    GYRO_BIAS,
    LEFT_SCALE,
    RIGHT_SCALE,
    Increment,
    OdometryNoise,
    Steps,
    visual_increment,
    wheel_increment,
)

_STILL_M = 0.0001  # less than an encoder count: who swings to a stop still turns
_STILL_RADPS = 0.05
_STILL_COV = np.diag([1e-5, 1e-5, 1e-5]) ** 2
RESOLUTION_M = 0.0005  # of a wheel's travel, once per interval
_TRACK_ERROR = 0.02  # relative: contact points are not where the drawing puts them
_SLIP_SIGMAS = 4.0
# How fast the robot may move when nothing measures it, and for how long the same way.
_BLIND_MPS, _BLIND_RADPS, _BLIND_S = 0.3, 1.0, 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Interval:
    """Motion over one interval, and the raw readings behind it (NaN and None: no such sensor)."""

    increment: Increment
    span_s: float
    left_m: float = math.nan
    right_m: float = math.nan
    gyro_yaw_rad: float | None = None
    still: bool = False
    slipped: bool = False

    @property
    def travel_m(self) -> float:
        """Distance rolled by the wheels, or moved where there are none."""
        motion = self.increment.previous_from_current
        moved = math.hypot(motion.x_m, motion.y_m)
        return moved if math.isnan(self.left_m) else max(abs(self.left_m), abs(self.right_m))


class Odometry:
    """Turns buffered samples into motion."""

    def __init__(self, config: SlamConfig, robot: RobotConfig) -> None:
        self.buffer = OdometryBuffer()
        rolled = math.hypot(config.wheel_noise_m_per_sqrt_m, config.slip_noise_m_per_sqrt_m)
        self._noise = OdometryNoise(rolled, config.gyro_noise_rad_per_sqrt_s, robot.track_width_m)
        self._without_slip_noise = config.wheel_noise_m_per_sqrt_m

    def since(
        self, mark: Mark, t_ns: int, calibration: np.ndarray, visual: VisualMotion | None = None
    ) -> Interval | None:
        """Motion from `mark` to `t_ns`; None where nothing felt it."""
        if self.buffer.has_wheels(mark.t_ns, t_ns):
            return self._by_wheels(self.buffer.steps(mark, t_ns), calibration)
        if visual is None:
            return None
        gyro = self.buffer.gyro_yaw_rad(mark, t_ns)
        span_s = (t_ns - mark.t_ns) * 1e-9
        if gyro is not None:
            gyro -= float(calibration[GYRO_BIAS]) * span_s
        var = self._noise.gyro_rad_per_sqrt_s**2 * span_s
        increment = visual_increment(visual.previous_from_current, visual.cov, gyro, var)
        return Interval(increment, span_s, gyro_yaw_rad=gyro)

    @staticmethod
    def blind(motion: SE2, span_s: float) -> Interval:
        """A guess of the motion, with the noise of not knowing."""
        wide = np.array([_BLIND_MPS, _BLIND_MPS, _BLIND_RADPS]) * math.sqrt(span_s * _BLIND_S)
        return Interval(Increment(motion, np.zeros((3, 4)), np.diag(wide**2)), span_s)

    def _by_wheels(self, steps: Steps, calibration: np.ndarray) -> Interval:
        span_s = float(steps.duration_s.sum())
        raw = float(steps.left_m.sum()), float(steps.right_m.sum())
        if steps.yaw_rad is None:
            return Interval(wheel_increment(steps, calibration, self._noise), span_s, *raw)
        gyro = float(steps.yaw_rad.sum())
        turn = gyro - float(calibration[GYRO_BIAS]) * span_s
        if max(map(abs, raw)) < _STILL_M and abs(turn) < _STILL_RADPS * span_s:
            stay = Increment(SE2(), np.zeros((3, 4)), _STILL_COV)
            return Interval(stay, span_s, *raw, gyro, still=True)
        left = raw[0] * (1.0 + float(calibration[LEFT_SCALE]))
        right = raw[1] * (1.0 + float(calibration[RIGHT_SCALE]))
        width = self._noise.track_width_m
        excess_m = turn * width - (right - left)  # what the left wheel rolled too far
        sigma_m = width * math.sqrt(self._wheel_yaw_var(left, right, turn, span_s))
        slipped = abs(excess_m) > _SLIP_SIGMAS * sigma_m
        if slipped:
            increment = self._without_slip(steps, calibration, left, right, excess_m)
        else:
            increment = wheel_increment(steps, calibration, self._noise)
        return Interval(increment, span_s, *raw, gyro, slipped=slipped)

    def _wheel_yaw_var(self, left: float, right: float, turn: float, span_s: float) -> float:
        """Variance of (wheels' turn - gyro's turn) while nothing slips."""
        rolled = self._without_slip_noise**2 * (abs(left) + abs(right))
        wheels = (rolled + 2.0 * RESOLUTION_M**2) / self._noise.track_width_m**2
        return wheels + self._noise.gyro_rad_per_sqrt_s**2 * span_s + (_TRACK_ERROR * turn) ** 2

    def _without_slip(
        self, steps: Steps, calibration: np.ndarray, left: float, right: float, excess_m: float
    ) -> Increment:
        """Shorten the wheel that ran ahead; in doubt half each. The distance stays doubtful."""
        shorter_left = abs(left - excess_m) - abs(left)
        shorter_right = abs(right + excess_m) - abs(right)
        doubt = abs(shorter_left - shorter_right) < 0.5 * abs(excess_m)
        share = 0.5 if doubt else float(shorter_left < shorter_right)
        trimmed = replace(
            steps,
            left_m=_rescaled(steps.left_m, -share * excess_m),
            right_m=_rescaled(steps.right_m, (1.0 - share) * excess_m),
        )
        increment = wheel_increment(trimmed, calibration, self._noise)
        cov = increment.cov.copy()
        cov[0, 0] += (0.25 * excess_m) ** 2
        return replace(increment, cov=cov)


def _rescaled(travel_m: np.ndarray, change_m: float) -> np.ndarray:
    """Travel (n,) whose sum grew by `change_m`, spread like the travel itself."""
    size = np.abs(travel_m)
    total = float(size.sum())
    share = size / total if total > 0.0 else np.full(len(size), 1.0 / len(size))
    return travel_m + change_m * share
