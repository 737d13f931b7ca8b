"""The gyro's bias: from standing still, from what the eyes see, never from swinging to a stop."""

import math

import numpy as np
import pytest

from robot.config import RobotConfig, SlamConfig
from robot.geometry.se2 import SE2
from robot.messages import VisualMotion
from robot.slam.calibration import Calibrator
from robot.slam.ekf import CALIBRATION, LandmarkFilter
from robot.slam.motion import GYRO_BIAS, Increment
from robot.slam.odometry import Interval

SPAN_S, TURN_RADPS, BIAS_RADPS = 0.1, 0.4, 0.012
NOTHING = Increment(SE2(), np.zeros((3, 4)), np.zeros((3, 3)))


def calibrated(sigma_radps: float = 0.02) -> tuple[Calibrator, LandmarkFilter]:
    ekf = LandmarkFilter(np.array([0.0] * 3 + [sigma_radps, 0.02, 0.02, 0.02] + [1.0] * 3))
    return Calibrator(SlamConfig(), RobotConfig(), ekf), ekf


def bias(ekf: LandmarkFilter) -> float:
    return float(ekf.x[CALIBRATION][GYRO_BIAS])


@pytest.mark.parametrize(("points", "learns"), [(60, True), (20, False)])
def test_what_many_points_tell_of_the_turn_teaches_the_bias(points: int, learns: bool) -> None:
    calibrator, ekf = calibrated()
    rng = np.random.default_rng(1)
    gyro_rad = (TURN_RADPS + BIAS_RADPS) * SPAN_S
    for _ in range(400):
        seen = SE2(0.02, 0.0, TURN_RADPS * SPAN_S + rng.normal(0.0, 2e-4))
        visual = VisualMotion(seen, np.diag([1e-3, 1e-3, 5e-4]) ** 2, points)
        slips = Interval(NOTHING, SPAN_S, 0.03, 0.01, gyro_rad, slipped=True)
        calibrator.learn(slips, visual)
    assert bias(ekf) == pytest.approx(BIAS_RADPS if learns else 0.0, abs=5e-4)


def test_a_false_motion_is_not_believed() -> None:
    calibrator, ekf = calibrated(3e-4)
    visual = VisualMotion(SE2(0.02, 0.0, 0.01), np.diag([1e-3, 1e-3, 5e-4]) ** 2, 80)
    for _ in range(11):
        calibrator.learn(Interval(NOTHING, SPAN_S, 0.001, 0.001, 0.0), visual)
    assert bias(ekf) == 0.0


def test_swinging_to_a_stop_is_no_standstill() -> None:
    for turned_rad, learns in ((0.002, False), (2e-5, True)):
        calibrator, ekf = calibrated(3e-4)
        calibrator.learn(Interval(NOTHING, SPAN_S, 0.0, 0.0, turned_rad, still=True))
        assert (bias(ekf) != 0.0) is learns and math.isfinite(bias(ekf))
