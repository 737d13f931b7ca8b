"""Errors of tracks: what a rigid motion must not change, and what an error must show."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from robot.evaluate.latency import percentiles
from robot.evaluate.trajectory import align, associate, compare_tracks, path_length_m
from robot.geometry.se2 import SE2

coordinate = st.floats(-50.0, 50.0)
angle = st.floats(-math.pi, math.pi)
poses = st.builds(SE2, coordinate, coordinate, angle)


def wander(seed: int, n: int = 60) -> np.ndarray:
    rng = np.random.default_rng(seed)
    yaw = np.cumsum(rng.normal(0.0, 0.3, n))
    steps = 0.1 * np.column_stack([np.cos(yaw), np.sin(yaw)])
    return np.column_stack([0.1 * np.arange(n), np.cumsum(steps, axis=0), yaw])


def moved(track: np.ndarray, by: SE2) -> np.ndarray:
    return np.column_stack([track[:, 0], by.apply(track[:, 1:3]), track[:, 3] + by.yaw_rad])


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 1000), poses)
def test_a_rigid_motion_is_no_error(seed: int, by: SE2) -> None:
    truth = wander(seed)
    error = compare_tracks(moved(truth, by.inverse()), truth)
    assert error is not None
    assert error.ate_rmse_m < 1e-9 and error.yaw_rmse_rad < 1e-9
    assert error.start_rmse_m < 1e-9 and error.start_yaw_rmse_rad < 1e-9
    assert error.true_from_estimate.distance_m(by) < 1e-9


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 1000), poses, poses)
def test_the_error_does_not_depend_on_the_frames(seed: int, a: SE2, b: SE2) -> None:
    truth = wander(seed)
    noise = np.random.default_rng(seed + 1).normal(0.0, 0.05, truth.shape)
    estimate = truth + noise * [0, 1, 1, 1]
    plain = compare_tracks(estimate, truth)
    other = compare_tracks(moved(estimate, a), moved(truth, b))
    assert plain is not None and other is not None
    assert other.ate_rmse_m == pytest.approx(plain.ate_rmse_m, abs=1e-9)
    assert other.yaw_rmse_rad == pytest.approx(plain.yaw_rmse_rad, abs=1e-9)
    assert other.start_rmse_m == pytest.approx(plain.start_rmse_m, abs=1e-9)


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 1000), st.floats(-0.5, 0.5), st.floats(-0.2, 0.2), st.floats(-0.2, 0.2))
def test_no_other_alignment_is_better(seed: int, turn: float, dx: float, dy: float) -> None:
    assume(abs(turn) + abs(dx) + abs(dy) > 1e-3)
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(20, 2))
    b = SE2(1.0, 2.0, 0.7).apply(a) + rng.normal(0.0, 0.1, a.shape)
    best = align(a, b)
    other = best @ SE2(dx, dy, turn)
    assert np.sum((best.apply(a) - b) ** 2) <= np.sum((other.apply(a) - b) ** 2) + 1e-12


def test_known_errors_come_out_as_they_are() -> None:
    truth = np.array([[0.0, 0, 0, 0], [1, 1, 0, 0], [2, 2, 0, 0], [3, 3, 0, 0]])
    estimate = truth.copy()
    estimate[:, 2] = [0.1, -0.1, -0.1, 0.1]  # symmetric: the best alignment is none
    estimate[:, 3] = 0.2
    error = compare_tracks(estimate, truth)
    assert error is not None and error.poses == 4
    assert error.ate_rmse_m == pytest.approx(0.1)
    assert error.worst_m == pytest.approx(0.1)
    assert error.yaw_rmse_rad == pytest.approx(0.2)
    assert error.start_yaw_rmse_rad == pytest.approx(0.0)
    assert path_length_m(truth) == 3.0 and path_length_m(truth[:1]) == 0.0


def test_truth_is_interpolated_over_short_gaps_and_the_short_way_round() -> None:
    truth = np.array([[0.0, 0, 0, 3.1], [0.2, 2, 0, -3.1], [5.0, 9, 9, 0]])
    estimate = np.array([[-0.1, 0, 0, 0], [0.05, 0, 0, 0], [0.2, 0, 0, 0], [1, 0, 0, 0]])
    kept, at = associate(estimate, truth)
    assert kept[:, 0].tolist() == [0.05, 0.2]
    assert at[0, 1] == pytest.approx(0.5)
    assert at[0, 3] == pytest.approx(3.1 + 0.25 * (2 * math.pi - 6.2))
    assert at[1, 1:3].tolist() == [2.0, 0.0]


def test_tracks_without_common_times_cannot_be_compared() -> None:
    track = wander(0)
    assert compare_tracks(track, track[:0]) is None
    assert compare_tracks(track[:0], track) is None
    assert compare_tracks(track + np.array([100, 0, 0, 0]), track) is None
    assert compare_tracks(track[:1], track) is None


def test_standing_still_is_aligned_by_shifting() -> None:
    still = np.zeros((5, 4))
    still[:, 0] = np.arange(5) * 0.1
    error = compare_tracks(still, still + np.array([0, 3.0, 4.0, 0]))
    assert error is not None and error.ate_rmse_m == 0.0


def test_percentiles_leave_out_the_unknown() -> None:
    values = [*range(1, 101), math.nan]
    assert percentiles(values) == {"p50": 50.5, "p95": 95.05, "p99": 99.01}
    assert percentiles([]) == {"p50": None, "p95": None, "p99": None}
    assert percentiles([math.nan])["p50"] is None
