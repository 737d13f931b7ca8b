"""The group laws of planar motions, on random elements."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from robot.geometry.se2 import SE2, exp, interpolate, wrap_angle

metres = st.floats(-50.0, 50.0)
angles = st.floats(-3.1, 3.1)
poses = st.builds(SE2, metres, metres, angles)


def close(a: SE2, b: SE2, tolerance: float = 1e-8) -> bool:
    return (
        abs(a.x_m - b.x_m) < tolerance
        and abs(a.y_m - b.y_m) < tolerance
        and abs(wrap_angle(a.yaw_rad - b.yaw_rad)) < tolerance
    )


@given(poses, poses, poses)
def test_composition_is_associative(a, b, c):
    assert close((a @ b) @ c, a @ (b @ c))


@given(poses)
def test_inverse_cancels_on_both_sides(pose):
    assert close(pose @ pose.inverse(), SE2())
    assert close(pose.inverse() @ pose, SE2())


@given(poses)
def test_exp_of_log_is_the_motion(pose):
    assert close(exp(*pose.log()), pose)


@given(poses, poses)
def test_points_move_as_the_composition_does(a, b):
    points = np.array([[0.0, 0.0], [1.0, -2.0], [0.3, 4.0]])
    np.testing.assert_allclose((a @ b).apply(points), a.apply(b.apply(points)), atol=1e-8)


@given(poses, poses)
def test_interpolation_starts_and_ends_at_the_given_poses(a, b):
    assert close(interpolate(a, b, 0.0), a)
    assert close(interpolate(a, b, 1.0), b, 1e-6)


@given(st.floats(-1e3, 1e3))
def test_wrapped_angle_points_the_same_way(angle):
    wrapped = wrap_angle(angle)
    assert -math.pi <= wrapped < math.pi
    assert math.isclose(math.cos(wrapped), math.cos(angle), abs_tol=1e-9)
    assert math.isclose(math.sin(wrapped), math.sin(angle), abs_tol=1e-9)


def test_quarter_turn_puts_forward_to_the_left():
    assert close(SE2(1.0, 0.0, math.pi / 2) @ SE2(2.0, 0.0, 0.0), SE2(1.0, 2.0, math.pi / 2))


def test_arc_of_a_quarter_circle():
    radius = 0.5
    assert close(exp(radius * math.pi / 2, 0.0, math.pi / 2), SE2(radius, radius, math.pi / 2))
