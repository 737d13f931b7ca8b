"""Increments and their composition against numbers found by finite differences."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numeric import derivative

from robot.geometry.se2 import SE2, exp
from robot.slam.motion import (
    OdometryNoise,
    Steps,
    compose,
    visual_increment,
    wheel_increment,
)

NOISE = OdometryNoise(0.02, 0.003, 0.23)


def as_array(motion: SE2) -> np.ndarray:
    return np.array([motion.x_m, motion.y_m, motion.yaw_rad])


def some_steps(seed: int, gyro: bool, n: int = 6) -> Steps:
    rng = np.random.default_rng(seed)
    left, right = rng.uniform(-0.03, 0.05, (2, n))
    yaw = (right - left) / 0.23 + rng.normal(0, 0.01, n) if gyro else None
    return Steps(rng.uniform(0.01, 0.03, n), left, right, yaw)


def test_equal_wheels_drive_straight() -> None:
    steps = Steps(np.full(5, 0.02), np.full(5, 0.005), np.full(5, 0.005), None)
    motion = wheel_increment(steps, np.zeros(4), NOISE).previous_from_current
    assert as_array(motion) == pytest.approx([0.025, 0.0, 0.0], abs=1e-15)


def test_unequal_wheels_drive_the_exact_arc() -> None:
    steps = Steps(np.full(4, 0.02), np.full(4, 0.01), np.full(4, 0.03), None)
    motion = wheel_increment(steps, np.zeros(4), NOISE).previous_from_current
    assert as_array(motion) == pytest.approx(as_array(exp(0.08, 0.0, 0.08 / 0.23)), abs=1e-12)


def test_gyro_decides_the_turn() -> None:
    steps = Steps(np.full(2, 0.1), np.full(2, 0.02), np.full(2, 0.02), np.array([0.3, 0.3]))
    increment = wheel_increment(steps, np.array([0.5, 0.0, 0.0, 0.0]), NOISE)
    assert increment.previous_from_current.yaw_rad == pytest.approx(0.6 - 0.5 * 0.2)


@pytest.mark.parametrize("gyro", [True, False])
@given(seed=st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_calibration_jacobian(gyro: bool, seed: int) -> None:
    steps = some_steps(seed, gyro)
    at = np.array([0.02, -0.03, 0.04, 0.05])

    def end(calibration: np.ndarray) -> np.ndarray:
        return as_array(wheel_increment(steps, calibration, NOISE).previous_from_current)

    analytic = wheel_increment(steps, at, NOISE).calibration_jacobian
    assert analytic == pytest.approx(derivative(end, at), abs=1e-8)


@pytest.mark.parametrize("gyro", [True, False])
@given(seed=st.integers(0, 10_000))
@settings(max_examples=15, deadline=None)
def test_covariance_is_the_noise_of_every_sample_carried_to_the_end(gyro: bool, seed: int) -> None:
    steps = some_steps(seed, gyro)
    n = len(steps.left_m)

    def end(samples: np.ndarray) -> np.ndarray:
        yaw = samples[2 * n :] if gyro else None
        moved = Steps(steps.duration_s, samples[:n], samples[n : 2 * n], yaw)
        return as_array(wheel_increment(moved, np.zeros(4), NOISE).previous_from_current)

    samples = np.concatenate([steps.left_m, steps.right_m, *([steps.yaw_rad] if gyro else [])])
    var = np.concatenate([0.02**2 * np.abs(samples[: 2 * n]), 0.003**2 * steps.duration_s])
    jacobian = derivative(end, samples)
    wanted = (jacobian * var[: len(samples)]) @ jacobian.T
    assert wheel_increment(steps, np.zeros(4), NOISE).cov == pytest.approx(wanted, abs=1e-9)


@given(
    st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(-3, 3)),
    st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-0.1, 0.1)),
)
def test_composition_and_its_jacobians(pose: tuple, step: tuple) -> None:
    end, by_pose, by_increment = compose(np.array(pose), SE2(*step))
    assert end == pytest.approx(as_array(SE2(*pose) @ SE2(*step)), abs=1e-12)
    assert by_pose == pytest.approx(
        derivative(lambda p: compose(p, SE2(*step))[0], np.array(pose)), abs=1e-7
    )
    assert by_increment == pytest.approx(
        derivative(lambda s: compose(np.array(pose), SE2(*s))[0], np.array(step)), abs=1e-7
    )


def test_visual_motion_takes_its_yaw_from_the_surer_source() -> None:
    cov = np.diag([1e-4, 1e-4, 1e-4])
    cov[1, 2] = cov[2, 1] = 5e-5
    seen = SE2(0.02, 0.0, 0.0)
    alone = visual_increment(seen, cov, None, 0.0)
    assert alone.previous_from_current == seen and np.array_equal(alone.cov, cov)
    merged = visual_increment(seen, cov, 0.1, 1e-10)
    assert merged.previous_from_current.yaw_rad == pytest.approx(0.1, abs=1e-4)
    # y and yaw err together, so learning the yaw corrects y as well
    assert merged.previous_from_current.y_m == pytest.approx(0.05, abs=1e-3)
    assert merged.cov[2, 2] < 1e-9 and merged.cov[1, 1] == pytest.approx(7.5e-5, rel=1e-3)
    assert math.isclose(merged.cov[0, 0], 1e-4)
