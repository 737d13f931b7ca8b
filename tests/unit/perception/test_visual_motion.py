"""Visual motion: exact on exact points, robust, honest about its uncertainty."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from perception_views import CAMERA, DRIVE, perception, view

from robot.geometry.se2 import SE2
from robot.perception.odometry import VisualOdometry
from robot.perception.point_stereo import Points

COUNT = 60


def cloud(seed: int) -> np.ndarray:
    """Points (n, 3) in `base`, in front of the camera."""
    rng = np.random.default_rng(seed)
    x = rng.uniform(0.9, 3.0, COUNT)
    return np.column_stack([x, rng.uniform(-0.4, 0.4, COUNT) * x, rng.uniform(0.0, 0.5, COUNT)])


def seen(points_m: np.ndarray, noise_px: float = 0.0, seed: int = 0) -> Points:
    rng = np.random.default_rng(seed)
    u, v, d = CAMERA.pixel_from_base(points_m)
    noise = noise_px * rng.standard_normal((3, len(u)))
    ids = np.arange(len(u))
    pixel = np.column_stack([u + noise[0], v + noise[1]])
    return Points(pixel, d + noise[2], np.ones(len(u), bool), ids, np.full(len(u), 9))


def moved(points_m: np.ndarray, motion: SE2) -> np.ndarray:
    """The same points in `base` after the robot made `motion`."""
    return np.column_stack([motion.inverse().apply(points_m[:, :2]), points_m[:, 2]])


@settings(max_examples=30, deadline=None)
@given(st.floats(-0.05, 0.05), st.floats(-0.02, 0.02), st.floats(-0.15, 0.15), st.integers(0, 99))
def test_exact_points_give_the_exact_motion(x: float, y: float, yaw: float, seed: int) -> None:
    odometry, points = VisualOdometry(CAMERA), cloud(seed)
    odometry.update(seen(points), math.nan)
    motion, _ = odometry.update(seen(moved(points, SE2(x, y, yaw))), math.nan)
    assert motion is not None
    assert motion.inliers == COUNT
    found = motion.previous_from_current
    assert (found.x_m, found.y_m, found.yaw_rad) == pytest.approx((x, y, yaw), abs=1e-4)


def test_a_third_of_wrong_points_changes_nothing_and_is_named() -> None:
    odometry, points = VisualOdometry(CAMERA), cloud(1)
    odometry.update(seen(points), math.nan)
    now = moved(points, SE2(0.025, 0.0, 0.05))
    wrong = np.arange(COUNT) % 3 == 0
    now[wrong, 1] += 0.2  # a cat walks by
    motion, checked = odometry.update(seen(now), 0.04)
    assert motion is not None
    assert motion.previous_from_current.x_m == pytest.approx(0.025, abs=2e-3)
    assert motion.previous_from_current.yaw_rad == pytest.approx(0.05, abs=2e-3)
    assert not checked.steady[wrong].any()
    assert checked.steady[~wrong].all()


def test_the_covariance_covers_the_error() -> None:
    chi2 = []
    for seed in range(60):
        odometry, points = VisualOdometry(CAMERA), cloud(seed)
        truth = SE2(0.025, 0.0, 0.03)
        odometry.update(seen(points, 0.2, 2 * seed), math.nan)
        motion, _ = odometry.update(seen(moved(points, truth), 0.2, 2 * seed + 1), math.nan)
        assert motion is not None
        found = motion.previous_from_current
        error = np.array(
            [found.x_m - truth.x_m, found.y_m - truth.y_m, found.yaw_rad - truth.yaw_rad]
        )
        chi2.append(error @ np.linalg.solve(motion.cov, error))
    assert 0.3 < np.mean(chi2) < 3.5


def test_few_or_contradicting_points_give_no_motion() -> None:
    odometry, points = VisualOdometry(CAMERA), cloud(2)
    assert odometry.update(seen(points), math.nan)[0] is None  # nothing before
    few = seen(points)
    few = replace(few, disparity_px=np.where(np.arange(COUNT) < 5, few.disparity_px, np.nan))
    assert odometry.update(few, math.nan)[0] is None
    odometry.update(seen(points), math.nan)
    scattered = cloud(3)
    motion, checked = odometry.update(seen(scattered), math.nan)
    assert motion is None
    assert checked.steady.all()


def test_no_points_at_all_are_survived() -> None:
    odometry = VisualOdometry(CAMERA)
    empty = seen(np.empty((0, 3)))
    assert odometry.update(empty, math.nan)[0] is None
    assert odometry.update(empty, 0.0)[0] is None


def test_motion_in_the_rendered_flat() -> None:
    chain = perception(matcher="sgbm")
    errors = []
    for seq, pose in enumerate(DRIVE):
        frame, _ = view(seq, pose)
        motion = chain.see(frame, 0).motion
        assert (motion is None) == (seq == 0)
        if motion is not None:
            truth = DRIVE[seq - 1].inverse() @ pose
            off = truth.inverse() @ motion.previous_from_current
            errors.append((off.x_m, off.y_m, off.yaw_rad))
    worst = np.abs(errors).max(axis=0)
    assert worst[0] < 0.004 and worst[1] < 0.004 and worst[2] < 0.004


@pytest.mark.parametrize("nod_px", [-1.5, 0.8])
def test_a_nod_of_the_camera_is_no_travel(nod_px: float) -> None:
    odometry, points = VisualOdometry(CAMERA), cloud(2)
    odometry.update(seen(points, 0.1, 1), math.nan)
    now = seen(moved(points, SE2(0.025, 0.0, 0.02)), 0.1, 2)
    motion, _ = odometry.update(replace(now, pixel=now.pixel + [0.0, nod_px]), 0.02)
    assert motion is not None and motion.inliers > 0.9 * COUNT
    assert motion.previous_from_current.x_m == pytest.approx(0.025, abs=0.003)
    assert motion.previous_from_current.yaw_rad == pytest.approx(0.02, abs=0.002)


def test_points_are_expected_where_a_steady_motion_takes_them() -> None:
    odometry, points, step = VisualOdometry(CAMERA), cloud(3), SE2(0.03, 0.0, 0.05)
    assert odometry.expected_pixels(math.nan).shape == (0, 2)
    odometry.update(seen(points), math.nan)
    points = moved(points, step)
    odometry.update(seen(points), math.nan)
    expected = odometry.expected_pixels(math.nan)
    np.testing.assert_allclose(expected, seen(moved(points, step)).pixel, atol=0.02)
    turning = odometry.expected_pixels(0.08)  # the gyro knows better
    np.testing.assert_allclose(turning, seen(moved(points, SE2(0.03, 0.0, 0.08))).pixel, atol=0.02)


def test_points_without_stereo_are_expected_to_turn_only() -> None:
    odometry, points = VisualOdometry(CAMERA), cloud(4)
    blind = replace(seen(points), disparity_px=np.full(COUNT, np.nan))
    odometry.update(blind, math.nan)
    shift = odometry.expected_pixels(0.1)[:, 0] - blind.pixel[:, 0]
    assert np.all(shift > 0.08 * CAMERA.focal_px)
