"""The error measures against the same thing written with plain loops."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.evaluate.stereo import (
    StereoErrors,
    fill_background,
    mean_errors,
    stereo_errors,
)


def brute_errors(estimate, truth, mask):
    count = there = 0
    bad = [0, 0, 0]
    total = 0.0
    for y in range(truth.shape[0]):
        for x in range(truth.shape[1]):
            t, e = float(truth[y, x]), float(estimate[y, x])
            if not (0 < t < 64) or not mask[y, x]:
                continue
            count += 1
            if math.isnan(e):
                bad = [b + 1 for b in bad]
                continue
            there += 1
            total += abs(e - t)
            bad = [b + (abs(e - t) > n) for b, n in zip(bad, (1, 2, 3), strict=True)]
    return count, there, bad, total


def brute_fill(disparity):
    height, width = disparity.shape
    filled = disparity.copy()
    full_rows = [y for y in range(height) if not np.isnan(disparity[y]).all()]
    for y in full_rows:
        for x in range(width):
            if not math.isnan(disparity[y, x]):
                continue
            left = next((disparity[y, i] for i in range(x, -1, -1) if disparity[y, i] > -1), None)
            right = next((disparity[y, i] for i in range(x, width) if disparity[y, i] > -1), None)
            filled[y, x] = min(v for v in (left, right) if v is not None)
    if full_rows:
        for y in range(height):
            if y not in full_rows:
                filled[y] = filled[min(full_rows, key=lambda r: (abs(r - y), r))]
    return filled


def random_maps(seed, gaps):
    rng = np.random.default_rng(seed)
    size = int(rng.integers(1, 9)), int(rng.integers(1, 12))
    truth = rng.uniform(-5, 80, size).astype(np.float32)
    truth[rng.random(size) < 0.2] = np.nan
    truth[rng.random(size) < 0.1] = np.inf
    estimate = (np.nan_to_num(truth, posinf=3.0) + rng.normal(0, 2, size)).astype(np.float32)
    estimate = np.abs(estimate)
    estimate[rng.random(size) < gaps] = np.nan
    return estimate, truth, rng.random(size) < 0.7


@settings(max_examples=80, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([0.0, 0.3, 0.9, 1.0]))
def test_errors_agree_with_plain_loops(seed, gaps):
    estimate, truth, mask = random_maps(seed, gaps)
    count, there, bad, total = brute_errors(estimate, truth, mask)
    got = stereo_errors(estimate, truth, mask)
    if count == 0:
        assert all(math.isnan(getattr(got, n)) for n in StereoErrors.__slots__)
        return
    assert got.density_pct == pytest.approx(100 * there / count)
    expected = [100 * b / count for b in bad]
    assert [got.bad1_pct, got.bad2_pct, got.bad3_pct] == pytest.approx(expected)
    if there:
        assert got.epe_px == pytest.approx(total / there, rel=1e-5)
    else:
        assert math.isnan(got.epe_px)


@settings(max_examples=80, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([0.1, 0.5, 0.95]))
def test_fill_agrees_with_plain_loops(seed, gaps):
    estimate, _, _ = random_maps(seed, gaps)
    np.testing.assert_array_equal(fill_background(estimate), brute_fill(estimate))


def test_fill_takes_the_farther_neighbour_and_keeps_what_is_known():
    row = np.array([[np.nan, 5.0, np.nan, np.nan, 2.0, np.nan]], np.float32)
    np.testing.assert_array_equal(fill_background(row), [[5, 5, 2, 2, 2, 2]])


def test_a_map_without_any_value_stays_empty():
    assert np.isnan(fill_background(np.full((3, 4), np.nan, np.float32))).all()


def test_a_hole_is_an_error_but_does_not_count_in_the_mean():
    truth = np.full((1, 4), 10.0, np.float32)
    estimate = np.array([[10.0, 11.5, np.nan, 14.0]], np.float32)
    assert stereo_errors(estimate, truth) == StereoErrors(
        75.0, 75.0, 50.0, 50.0, pytest.approx(5.5 / 3)
    )


def test_truth_outside_the_range_does_not_count():
    truth = np.array([[0.0, 64.0, 70.0, np.nan, 63.5]], np.float32)
    estimate = np.array([[9.0, 9.0, 9.0, 9.0, 63.5]], np.float32)
    assert stereo_errors(estimate, truth).bad1_pct == 0.0


def test_sizes_must_agree():
    with pytest.raises(ValueError, match="differ in size"):
        stereo_errors(np.zeros((2, 3)), np.zeros((3, 2)))


def test_mean_leaves_out_what_is_unknown():
    first = StereoErrors(100.0, 10.0, 4.0, 2.0, 1.0)
    second = StereoErrors(0.0, 100.0, 100.0, 100.0, float("nan"))
    assert mean_errors([first, second]) == StereoErrors(50.0, 55.0, 52.0, 51.0, 1.0)
