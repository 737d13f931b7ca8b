"""The frame of a map: it lies where the track so far was told to be."""

import numpy as np
import pytest

from robot.geometry.se2 import SE2
from robot.slam.ekf import FIRST_LANDMARK, POSE, LandmarkFilter
from robot.slam.survey.datum import Datum

TURN = SE2(0.4, -0.2, 0.3)


def drive(datum: Datum, legs: int) -> LandmarkFilter:
    """A filter with a waymark every 10 s of a bent way."""
    ekf = LandmarkFilter(np.full(FIRST_LANDMARK, 0.1), invariant=True)
    for k in range(legs):
        ekf.x[POSE] = (0.3 * k, 0.02 * k * k, 0.05 * k)
        if datum.due(10.0 * k):
            datum.leave(ekf, 10.0 * k)
    return ekf


def turn_all(ekf: LandmarkFilter) -> None:
    """What a better knowledge of the first heading does to all that the filter holds."""
    ekf.x[FIRST_LANDMARK:] = TURN.apply(ekf.landmarks()).reshape(-1)
    pose = TURN @ SE2(*ekf.x[POSE].tolist())
    ekf.x[POSE] = (pose.x_m, pose.y_m, pose.yaw_rad)


def test_what_turns_everything_changes_nothing_that_is_told() -> None:
    datum = Datum()
    ekf = drive(datum, 8)
    before = ekf.x[POSE].copy()
    turn_all(ekf)
    datum.follow(ekf.landmarks())
    pose, cov = datum.pose(ekf)
    assert pose == pytest.approx(before)
    assert np.linalg.eigvalsh(cov) == pytest.approx(np.full(3, 0.01))
    place, spread = datum.points(TURN.apply(np.array([[1.0, 2.0]])), np.diag([4.0, 1.0])[None])
    assert place[0] == pytest.approx([1.0, 2.0])
    turned = np.array([np.cos(-0.3), np.sin(-0.3)])
    assert turned @ spread[0] @ turned == pytest.approx(4.0)


def test_one_waymark_that_moves_alone_hardly_moves_the_frame() -> None:
    datum = Datum()
    ekf = drive(datum, 16)
    places = ekf.landmarks()
    places[3] += 0.1
    datum.follow(places)
    assert np.hypot(datum.told_from_filter.x_m, datum.told_from_filter.y_m) < 0.03
    assert abs(datum.told_from_filter.yaw_rad) < 0.03


def test_a_single_waymark_tells_no_frame() -> None:
    datum = Datum()
    ekf = drive(datum, 1)
    turn_all(ekf)
    datum.follow(ekf.landmarks())
    assert datum.told_from_filter == SE2()


def test_waymarks_stay_bounded_and_cover_the_whole_way() -> None:
    datum = Datum()
    ekf = LandmarkFilter(np.full(FIRST_LANDMARK, 0.1))
    for k in range(1000):
        ekf.x[POSE] = (0.1 * k, 0.0, 0.0)
        if datum.due(float(k)):
            datum.leave(ekf, float(k))
            ekf.keep(np.delete(np.arange(ekf.count), datum.thin()))
    places = ekf.landmarks()[:, 0]
    assert 16 <= ekf.count <= 32
    assert places[0] == 0.0 and places[-1] > 90.0
    assert np.diff(places).max() <= places[1]


def test_a_waymark_is_corrected_with_the_pose_that_it_was_left_at() -> None:
    datum = Datum()
    ekf = drive(datum, 1)
    ekf.update(np.array([[0, 1]]), np.eye(2)[None], np.array([[0.2, 0.1]]), 0.01 * np.eye(2)[None])
    assert ekf.landmarks()[0] == pytest.approx(ekf.x[POSE][:2])
