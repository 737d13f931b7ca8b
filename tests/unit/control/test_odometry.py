"""Dead reckoning: wheels and gyro become a smooth pose that can be asked for the recent past."""

import math

import pytest

from robot.config import RobotConfig
from robot.control.odometry import DeadReckoning
from robot.geometry.se2 import SE2
from robot.messages import ImuSample, WheelTravel

ROBOT = RobotConfig()
MS = 1_000_000


def roll(odometry, ticks, left_mps, right_mps, start_ns=0, left0=0.0, right0=0.0, gyro=None):
    for k in range(ticks + 1):
        t_ns = start_ns + 20 * MS * k
        if gyro is not None:
            odometry.imu(ImuSample(t_ns, gyro))
        odometry.wheels(
            WheelTravel(t_ns, t_ns, left0 + left_mps * k * 0.02, right0 + right_mps * k * 0.02)
        )


def test_straight_and_turning_by_wheels_alone():
    odometry = DeadReckoning(ROBOT)
    roll(odometry, 50, 0.2, 0.2)
    assert odometry.odom_from_base.x_m == pytest.approx(0.2)
    assert odometry.driven_m == pytest.approx(0.2)
    turn_mps = 0.5 * ROBOT.track_width_m
    roll(odometry, 50, -turn_mps, turn_mps, 2_000 * MS, 0.2, 0.2)
    assert odometry.odom_from_base.yaw_rad == pytest.approx(1.0)
    assert odometry.turned_rad == pytest.approx(1.0)


def test_a_fresh_gyro_overrules_slipping_wheels_and_its_bias_is_learned_at_rest():
    odometry = DeadReckoning(ROBOT)
    roll(odometry, 200, 0.0, 0.0, gyro=0.02)
    assert odometry.odom_from_base == SE2()
    roll(odometry, 50, 0.1, 0.13, 4_020 * MS, gyro=0.02)  # one wheel slips: no true turn
    assert odometry.odom_from_base.yaw_rad == pytest.approx(0.0, abs=2e-3)


def test_a_silent_gyro_is_not_believed():
    odometry = DeadReckoning(ROBOT)
    odometry.imu(ImuSample(0, 1.0))
    roll(odometry, 50, 0.1, 0.1, 500 * MS)
    assert odometry.odom_from_base.yaw_rad == 0.0


def test_a_lost_packet_costs_nothing_and_an_old_one_is_ignored():
    odometry = DeadReckoning(ROBOT)
    odometry.wheels(WheelTravel(0, 0, 0.0, 0.0))
    odometry.wheels(WheelTravel(100 * MS, 100 * MS, 0.5, 0.5))
    odometry.wheels(WheelTravel(50 * MS, 120 * MS, 0.1, 0.1))
    assert odometry.odom_from_base.x_m == pytest.approx(0.5)
    assert odometry.t_ns == 100 * MS


def test_past_poses_are_interpolated_and_clamped():
    odometry = DeadReckoning(ROBOT)
    assert odometry.at(5) == SE2()
    roll(odometry, 200, 0.1, 0.1)
    now_ns = 4_000 * MS
    assert odometry.at(now_ns - 510 * MS).x_m == pytest.approx(0.4 - 0.051)
    assert odometry.at(now_ns + MS).x_m == pytest.approx(0.4)
    assert odometry.at(0).x_m == pytest.approx(0.4 - 0.1 * 99 * 0.02)
    assert math.isclose(odometry.at(now_ns).x_m, 0.4, abs_tol=1e-12)
