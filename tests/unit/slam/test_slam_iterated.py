"""A large correction, in one step and in several."""

import numpy as np
import pytest

from robot.slam.ekf import FIRST_LANDMARK, POSE, LandmarkFilter
from robot.slam.sensor import expected, residual
from robot.slam.survey.iterated import iterated_update

THINGS = np.array([[1.5, 0.4], [1.2, -0.5], [2.5, 0.1]])
NOISE = np.tile(np.diag([0.01, 0.01]) ** 2, (3, 1, 1))


def at_origin(sigma: float) -> LandmarkFilter:
    """A filter that knows the things well, and its own pose with `sigma` (m and rad)."""
    ekf = LandmarkFilter(np.array([sigma] * 3 + [1e-3] * 4 + [1.0] * 3), invariant=True)
    one = np.tile(np.eye(2), (3, 1, 1))
    ekf.add(THINGS, np.zeros((3, 2, 3)), one, 1e-6 * one)
    return ekf


def linearise(ekf: LandmarkFilter) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    predicted, by_pose, by_point = expected(ekf.x[POSE], ekf.landmarks())
    first = FIRST_LANDMARK + 2 * np.arange(3)[:, None]
    columns = np.hstack([np.tile(np.arange(3), (3, 1)), first, first + 1])
    return columns, np.concatenate([by_pose, by_point], axis=2), predicted


def test_a_leap_lands_where_one_step_does_not() -> None:
    true = np.array([-1.0, 0.6, 0.7])
    seen, _, _ = expected(true, THINGS)
    once, often = at_origin(1.0), at_origin(1.0)
    columns, jacobian, predicted = linearise(once)
    once.update(columns, jacobian, residual(seen, predicted), NOISE)
    iterated_update(often, lambda: linearise(often), seen, NOISE)
    assert np.abs(once.x[POSE] - true).max() > 0.3
    assert often.x[POSE] == pytest.approx(true, abs=0.05)
    np.linalg.cholesky(often.P)


def test_a_small_step_is_the_plain_one() -> None:
    seen, _, _ = expected(np.array([0.03, -0.02, 0.01]), THINGS)
    once, often = at_origin(0.05), at_origin(0.05)
    columns, jacobian, predicted = linearise(once)
    once.update(columns, jacobian, residual(seen, predicted), NOISE)
    iterated_update(often, lambda: linearise(often), seen, NOISE)
    assert np.array_equal(once.x, often.x) and np.array_equal(once.P, often.P)
