"""Memories that are asked by time."""

import math

import numpy as np
import pytest

from robot.geometry.se2 import SE2
from robot.slam.history import OdometryBuffer, PoseHistory, Series

MS = 1_000_000


def test_series_interpolates_extrapolates_shortly_and_then_holds() -> None:
    series = Series()
    for k in range(3):
        series.append(k * 20 * MS, k * 0.01)
    assert series.at(-5 * MS) == 0.0
    assert series.at(30 * MS) == pytest.approx(0.015)
    assert series.at(40 * MS + 50 * MS) == pytest.approx(0.045)
    assert series.at(900 * MS) == series.at(140 * MS) == pytest.approx(0.07)


def test_series_ignores_what_is_not_newer_and_forgets_what_is_old() -> None:
    series = Series()
    for k in range(2000):
        series.append(k * 20 * MS, float(k))
    series.append(100 * MS, 7.0)
    assert series.at(1999 * 20 * MS) == 1999.0
    assert len(series.t_ns) <= 1002
    assert series.at(1600 * 20 * MS + 10 * MS) == pytest.approx(1600.5)


def test_a_long_silence_is_not_covered() -> None:
    series = Series()
    for t_ms in (0, 20, 40, 400, 420):
        series.append(t_ms * MS, 0.0)
    assert series.covers(0, 40 * MS) and series.covers(400 * MS, 450 * MS)
    assert not series.covers(30 * MS, 410 * MS)
    assert not series.covers(400 * MS, 900 * MS)
    assert not Series().covers(0, 1)


def test_steps_add_up_to_the_travel_between_two_times() -> None:
    buffer = OdometryBuffer()
    for k in range(20):
        buffer.add_wheels(k * 20 * MS, 0.005 * k, 0.004 * k)
        buffer.add_gyro(k * 20 * MS + 7 * MS, 0.5)
    mark = buffer.mark(53 * MS)
    steps = buffer.steps(mark, 155 * MS)
    assert steps.duration_s.sum() == pytest.approx(0.102)
    assert steps.left_m.sum() == pytest.approx(0.25 * 0.102)
    assert steps.right_m.sum() == pytest.approx(0.20 * 0.102)
    assert steps.yaw_rad is not None and steps.yaw_rad.sum() == pytest.approx(0.051)
    assert len(steps.left_m) == 6


def test_travel_that_was_extrapolated_is_not_counted_twice() -> None:
    buffer = OdometryBuffer()
    buffer.add_wheels(0, 0.0, 0.0)
    buffer.add_wheels(20 * MS, 0.005, 0.005)
    first = buffer.steps(buffer.mark(0), 60 * MS).left_m.sum()
    mark = buffer.mark(60 * MS)
    buffer.add_wheels(40 * MS, 0.006, 0.006)
    buffer.add_wheels(80 * MS, 0.006, 0.006)
    assert first + buffer.steps(mark, 80 * MS).left_m.sum() == pytest.approx(0.006)


def test_counters_that_restart_lose_no_travel() -> None:
    buffer = OdometryBuffer()
    buffer.add_wheels(0, 12.0, 12.0)
    mark = buffer.mark(0)
    for k, left in enumerate([12.004, 0.0, 0.004, 0.008], start=1):
        buffer.add_wheels(k * 20 * MS, left, left)
    assert buffer.steps(mark, 80 * MS).left_m.sum() == pytest.approx(0.012)


def test_gyro_turn_is_unknown_without_a_gyro() -> None:
    buffer = OdometryBuffer()
    buffer.add_wheels(0, 0.0, 0.0)
    mark = buffer.mark(0)
    assert math.isnan(mark.yaw_rad)
    assert buffer.gyro_yaw_rad(mark, 100 * MS) is None
    for k in range(6):
        buffer.add_gyro(k * 20 * MS, 1.0)
    assert buffer.gyro_yaw_rad(mark, 100 * MS) == pytest.approx(0.1)


def test_pose_history_interpolates_and_keeps_its_ends() -> None:
    history = PoseHistory()
    history.append(0, SE2(0, 0, 0), np.eye(3))
    history.append(100 * MS, SE2(0.1, 0, 0.4), 3 * np.eye(3))
    pose, cov = history.at(50 * MS)
    assert pose.yaw_rad == pytest.approx(0.2) and 0.04 < pose.x_m < 0.06
    assert cov == pytest.approx(2 * np.eye(3))
    assert history.at(-1)[0] == SE2(0, 0, 0)
    assert history.at(900 * MS)[0] == SE2(0.1, 0, 0.4)
