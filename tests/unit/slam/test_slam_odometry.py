"""Slip, standstill and what replaces missing sensors."""

import numpy as np
import pytest

from robot.config import RobotConfig, SlamConfig
from robot.geometry.se2 import SE2
from robot.messages import VisualMotion
from robot.slam.odometry import Interval, Odometry

MS = 1_000_000
NO_CALIBRATION = np.zeros(4)


def roll(
    left_mps: float, right_mps: float, yaw_rate: float | None, odometry: Odometry | None = None
) -> Interval:
    """Motion over 100 ms at constant speeds."""
    odometry = odometry or Odometry(SlamConfig(), RobotConfig())
    for k in range(6):
        odometry.buffer.add_wheels(k * 20 * MS, left_mps * 0.02 * k, right_mps * 0.02 * k)
        if yaw_rate is not None:
            odometry.buffer.add_gyro(k * 20 * MS, yaw_rate)
    interval = odometry.since(odometry.buffer.mark(0), 100 * MS, NO_CALIBRATION)
    assert interval is not None
    return interval


def test_straight_drive_does_not_slip() -> None:
    interval = roll(0.25, 0.25, 0.0)
    assert not interval.slipped and not interval.still
    assert interval.increment.previous_from_current.x_m == pytest.approx(0.025)


def test_turn_in_place_does_not_slip() -> None:
    interval = roll(-0.115, 0.115, 1.0)
    assert not interval.slipped
    assert interval.increment.previous_from_current.yaw_rad == pytest.approx(0.1)


@pytest.mark.parametrize(("left", "right"), [(0.45, 0.25), (0.25, 0.45), (-0.45, -0.25)])
def test_the_wheel_that_spins_is_not_believed(left: float, right: float) -> None:
    interval = roll(left, right, 0.0)
    assert interval.slipped
    true_m = 0.025 if left > 0 else -0.025
    assert interval.increment.previous_from_current.x_m == pytest.approx(true_m, abs=1e-4)
    assert interval.increment.cov[0, 0] > 0.004**2  # but the distance stays doubtful


def test_without_a_gyro_the_wheels_turn_the_robot() -> None:
    interval = roll(0.1, 0.2, None)
    assert not interval.slipped
    assert interval.increment.previous_from_current.yaw_rad == pytest.approx(0.01 / 0.23)


def test_standstill_ignores_the_gyros_bias_but_not_a_carrying_hand() -> None:
    interval = roll(0.0, 0.0, 0.02)
    assert interval.still and interval.increment.previous_from_current == SE2()
    assert interval.gyro_yaw_rad == pytest.approx(0.002)
    assert not roll(-0.002, 0.002, 0.02).still  # swinging to a stop
    carried = roll(0.0, 0.0, 0.8)
    assert not carried.still
    assert carried.increment.previous_from_current.yaw_rad == pytest.approx(0.08)


def test_vision_stands_in_for_wheels_and_the_gyro_for_its_yaw() -> None:
    odometry = Odometry(SlamConfig(), RobotConfig())
    mark = odometry.buffer.mark(0)
    assert odometry.since(mark, 100 * MS, NO_CALIBRATION) is None
    visual = VisualMotion(SE2(0.03, 0.0, 0.02), np.diag([1e-5, 1e-5, 1e-4]), 30)
    seen = odometry.since(mark, 100 * MS, NO_CALIBRATION, visual)
    assert seen is not None
    assert seen.increment.previous_from_current.x_m == 0.03
    assert seen.increment.previous_from_current.yaw_rad == pytest.approx(0.02)
    for k in range(6):
        odometry.buffer.add_gyro(k * 20 * MS, 0.5)
    both = odometry.since(mark, 100 * MS, NO_CALIBRATION, visual)
    assert both is not None
    assert both.increment.previous_from_current.yaw_rad == pytest.approx(0.05, abs=0.003)
    assert both.increment.cov[2, 2] < 1e-6
