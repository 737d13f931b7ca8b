"""What odometry learns about itself: the gyro's bias, the wheels' difference.

At standstill the gyro tells its bias, while driving the turn that the eyes see does. All are plain
measurements of the filter's calibration states, so the landmarks, which see the same errors, share
in them.
"""

from __future__ import annotations

import numpy as np

from robot.config import RobotConfig, SlamConfig
from robot.geometry.se2 import wrap_angle
from robot.messages import VisualMotion
from robot.slam.ekf import CALIBRATION, LandmarkFilter
from robot.slam.motion import GYRO_BIAS, LEFT_SCALE, RIGHT_SCALE
from robot.slam.odometry import RESOLUTION_M, Interval

_BIAS_FLOOR_RADPS = 5e-4  # a bias is not steadier than this
_STRAIGHT_RADPS = 0.3  # turns compare the track width, straights the wheels' diameters
_STRAIGHT_M = 0.2  # rolled before the wheels are compared
_GATE_CHI2 = 9.0  # a robot that swings to a stop stands no more than a wheel's count says
_SIGHTED_S = 1.0  # of sighted motion are taken in together
_SIGHTED = 50  # points followed from one frame to the next: then their turn is good to 0.0002 rad


class Calibrator:
    """Feeds standstill and straights to the filter."""

    def __init__(self, config: SlamConfig, robot: RobotConfig, ekf: LandmarkFilter) -> None:
        self._config = config
        self._track_width_m = robot.track_width_m
        self._ekf = ekf
        self._straight = np.zeros(4)  # span_s, left_m, right_m, gyro yaw
        self._sighted = np.zeros(3)  # the gyro's turn beyond the one seen, span_s, variance of it

    def learn(self, interval: Interval, visual: VisualMotion | None = None) -> None:
        """Take in one interval of driving or standing, and what the eyes saw of the motion."""
        if interval.gyro_yaw_rad is None:
            return
        if interval.still:
            var = _BIAS_FLOOR_RADPS**2 * interval.span_s**2
            self._learn_bias(interval.gyro_yaw_rad, interval.span_s, var)
            return
        if visual is not None and visual.inliers >= _SIGHTED:
            away = wrap_angle(interval.gyro_yaw_rad - visual.previous_from_current.yaw_rad)
            self._sighted += away, interval.span_s, visual.cov[2, 2]
            if self._sighted[1] >= _SIGHTED_S:
                self._learn_bias(*self._sighted.tolist())
                self._sighted[:] = 0.0
        if interval.slipped:
            self._straight[:] = 0.0
            return
        bias = float(self._ekf.x[CALIBRATION][GYRO_BIAS])
        if abs(interval.gyro_yaw_rad - bias * interval.span_s) > _STRAIGHT_RADPS * interval.span_s:
            self._straight[:] = 0.0
            return
        self._straight += (
            interval.span_s,
            interval.left_m,
            interval.right_m,
            interval.gyro_yaw_rad,
        )
        if np.abs(self._straight[1:3]).max() > _STRAIGHT_M:
            self._compare(*self._straight.tolist())
            self._straight[:] = 0.0

    def _learn_bias(self, yaw_rad: float, span_s: float, var: float) -> None:
        """In `span_s` the gyro turned `yaw_rad` more than the robot, which is known with `var`."""
        var = (var + self._config.gyro_noise_rad_per_sqrt_s**2 * span_s) / span_s**2
        away = yaw_rad / span_s - float(self._ekf.x[CALIBRATION][GYRO_BIAS])
        own = float(self._ekf.head()[CALIBRATION, CALIBRATION][GYRO_BIAS, GYRO_BIAS])
        if away**2 < _GATE_CHI2 * (own + var):
            self._measure(np.array([1.0, 0.0, 0.0, 0.0]), away, var)

    def _compare(self, span_s: float, left_m: float, right_m: float, yaw_rad: float) -> None:
        """The gyro's turn is what the two wheels and the bias make of it."""
        calibration, width = self._ekf.x[CALIBRATION], self._track_width_m
        left = left_m * (1.0 + calibration[LEFT_SCALE])
        right = right_m * (1.0 + calibration[RIGHT_SCALE])
        expected = (right - left) / width + calibration[GYRO_BIAS] * span_s
        rolled = self._config.wheel_noise_m_per_sqrt_m**2 * (abs(left) + abs(right))
        var = (rolled + 2.0 * RESOLUTION_M**2) / width**2
        var += self._config.gyro_noise_rad_per_sqrt_s**2 * span_s
        jacobian = np.array([span_s, -left_m / width, right_m / width, 0.0])
        self._measure(jacobian, yaw_rad - float(expected), var)

    def _measure(self, jacobian: np.ndarray, away: float, var: float) -> None:
        columns = np.arange(CALIBRATION.start, CALIBRATION.stop)[None]
        self._ekf.update(columns, jacobian[None, None], np.array([[away]]), np.array([[[var]]]))
