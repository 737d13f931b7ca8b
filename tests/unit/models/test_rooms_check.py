"""Depth of rendered rooms through the robot's eyes."""

import numpy as np
import pytest

pytest.importorskip("numba")
from models import rooms_check
from robot.bench.stereo.matchers import Matcher


def test_rooms_look_as_from_the_robot_and_are_reproducible():
    pairs = rooms_check.room_pairs(3, seed=5)
    again = rooms_check.room_pairs(3, seed=5)
    assert len(pairs) == 3
    for one, other in zip(pairs, again, strict=True):
        np.testing.assert_array_equal(one.left, other.left)
        np.testing.assert_array_equal(one.truth_px, other.truth_px)
        floor = np.median(one.truth_px[-1])  # the nearest floor is about 0.17 m away
        assert 30 < floor < 140


def test_depth_errors_by_hand():
    at_1m, at_2m, at_4m = 13.68, 6.84, 3.42
    truth = np.array([[at_1m, at_1m, at_2m, at_4m, np.nan]])
    found = np.array([[at_1m, 2 * at_1m, np.nan, 50.0, 50.0]])
    relative, off = rooms_check.depth_errors(found, truth)
    np.testing.assert_allclose(relative, [0, 0.5, np.inf])
    np.testing.assert_allclose(off, [0, at_1m, np.inf])


def test_a_perfect_matcher_has_no_error():
    truth = np.full((240, 320), 10.0, np.float32)
    pair = rooms_check.RoomPair(*np.zeros((2, 240, 320), np.uint8), truth)
    row = rooms_check.measure(Matcher("perfect", lambda left, right: truth), [pair])
    assert row["median_depth_error_pct"] == 0.0 and row["bad1_pct"] == 0.0
    half = truth.copy()
    half[:180] = 12.5
    row = rooms_check.measure(Matcher("poor", lambda left, right: half), [pair])
    assert row["median_depth_error_pct"] == 20.0 and row["bad1_pct"] == 75.0
