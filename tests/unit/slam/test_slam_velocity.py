"""Motion by orders: lag, scales, curvature, and their derivatives."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numeric import derivative

from robot.geometry.se2 import SE2
from robot.slam.survey.velocity import LAG, Velocities, VelocityNoise, velocity_increment

NOISE = VelocityNoise(0.05, 0.04, 0.1, 0.01)


def as_array(motion: SE2) -> np.ndarray:
    return np.array([motion.x_m, motion.y_m, motion.yaw_rad])


def test_an_order_holds_until_the_next_and_nothing_moves_before_the_first() -> None:
    orders = Velocities(np.array([[1.0, 0.2, 0.0], [2.0, 0.0, 0.5]]))
    motion = velocity_increment(orders, 0.0, 4.0, np.zeros(4), NOISE).previous_from_current
    assert as_array(motion) == pytest.approx([0.2, 0.0, 1.0])


def test_lag_moves_the_orders_in_time() -> None:
    orders = Velocities(np.array([[0.0, 0.2, 0.0], [1.0, 0.0, 0.0]]))
    late = np.zeros(4)
    late[LAG] = 0.25
    moved = velocity_increment(orders, 0.0, 1.0, late, NOISE).previous_from_current
    assert as_array(moved) == pytest.approx([0.15, 0.0, 0.0])


@given(st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_jacobian_by_the_calibration(seed: int) -> None:
    rng = np.random.default_rng(seed)
    t_s = np.cumsum(rng.uniform(0.05, 0.3, 12))
    orders = Velocities(np.column_stack([t_s, rng.normal(0.1, 0.1, 12), rng.normal(0, 0.5, 12)]))
    at = rng.normal(0.0, 0.1, 4)
    start_s, end_s = 0.5, 1.7

    def end(calibration: np.ndarray) -> np.ndarray:
        increment = velocity_increment(orders, start_s, end_s, calibration, NOISE)
        return as_array(increment.previous_from_current)

    analytic = velocity_increment(orders, start_s, end_s, at, NOISE).calibration_jacobian
    assert analytic[:, :LAG] == pytest.approx(derivative(end, at)[:, :LAG], abs=1e-7)
    by_lag = derivative(end, at, step=0.02)[:, LAG]  # orders jump: only a finite step is smooth
    assert analytic[:, LAG] == pytest.approx(by_lag, abs=1e-9)


def test_noise_grows_with_the_way() -> None:
    orders = Velocities(np.array([[0.0, 0.5, 0.0]]))
    one = velocity_increment(orders, 0.0, 2.0, np.zeros(4), NOISE).cov
    two = velocity_increment(orders, 0.0, 4.0, np.zeros(4), NOISE).cov
    assert one[0, 0] == pytest.approx(0.05**2)
    assert two[0, 0] == pytest.approx(2 * one[0, 0])
    assert np.all(np.linalg.eigvalsh(two) > 0.0)
    still = Velocities(np.array([[0.0, 0.0, 0.0]]))
    assert velocity_increment(still, 0.0, 9.0, np.zeros(4), NOISE).cov == pytest.approx(0.0)
