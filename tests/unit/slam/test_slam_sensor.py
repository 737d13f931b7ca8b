"""The measurement function, its inverse and all their Jacobians."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numeric import derivative

from robot.slam.sensor import expected, expected_marker, locate, locate_marker, residual

poses = st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(-3.1, 3.1)).map(np.array)
sightings = st.tuples(st.floats(0.15, 5.0), st.floats(-1.2, 1.2)).map(np.array)
sights = st.tuples(st.floats(0.1, 3), st.floats(-2, 2), st.floats(-3.0, 3.0)).map(np.array)


def test_a_point_to_the_left_has_a_positive_bearing() -> None:
    sights, _, _ = expected(np.array([1.0, 1.0, np.pi / 2]), np.array([[0.0, 1.0], [1.0, 3.0]]))
    assert sights == pytest.approx(np.array([[1.0, np.pi / 2], [0.5, 0.0]]))


@given(poses, sightings)
def test_expected_undoes_locate(pose: np.ndarray, sight: np.ndarray) -> None:
    points, _, _ = locate(pose, sight[None])
    seen, _, _ = expected(pose, points)
    assert residual(seen, sight[None]) == pytest.approx(np.zeros((1, 2)), abs=1e-9)


@given(poses, sightings)
def test_jacobians_of_h(pose: np.ndarray, sight: np.ndarray) -> None:
    point = locate(pose, sight[None])[0][0]
    at, by_pose, by_point = expected(pose, point[None])

    def away(p: np.ndarray, q: np.ndarray) -> np.ndarray:
        return residual(expected(p, q[None])[0], at)

    assert by_pose[0] == pytest.approx(derivative(lambda p: away(p, point), pose), abs=1e-5)
    assert by_point[0] == pytest.approx(derivative(lambda q: away(pose, q), point), abs=1e-5)


@given(poses, sightings)
def test_jacobians_of_the_inverse(pose: np.ndarray, sight: np.ndarray) -> None:
    _, by_pose, by_sight = locate(pose, sight[None])
    assert by_pose[0] == pytest.approx(
        derivative(lambda p: locate(p, sight[None])[0][0], pose), abs=1e-7
    )
    assert by_sight[0] == pytest.approx(
        derivative(lambda z: locate(pose, z[None])[0][0], sight), abs=1e-7
    )


@given(poses, sights)
def test_marker_and_its_jacobians(pose: np.ndarray, seen: np.ndarray) -> None:
    marker, by_pose, by_seen = locate_marker(pose, seen)
    again, jacobian = expected_marker(pose, marker)
    assert residual(again[None], seen[None])[0] == pytest.approx(np.zeros(3), abs=1e-9)

    def inverse(p: np.ndarray, s: np.ndarray) -> np.ndarray:
        return residual(locate_marker(p, s)[0][None], marker[None])[0]

    assert by_pose == pytest.approx(derivative(lambda p: inverse(p, seen), pose), abs=1e-7)
    assert by_seen == pytest.approx(derivative(lambda s: inverse(pose, s), seen), abs=1e-7)

    def sight(both: np.ndarray) -> np.ndarray:
        return residual(expected_marker(both[:3], both[3:])[0][None], again[None])[0]

    both = np.concatenate([pose, marker])
    assert jacobian == pytest.approx(derivative(sight, both), abs=1e-7)


def test_residual_of_bearings_goes_the_short_way_round() -> None:
    away = residual(np.array([[1.0, 3.1]]), np.array([[0.5, -3.1]]))
    assert away == pytest.approx(np.array([[0.5, 6.2 - 2 * np.pi]]))
