"""Pixels, disparity and depth of a rectified pair."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from robot.config import CameraConfig
from robot.geometry.stereo import base_from_cam

CAMERA = CameraConfig(pitch_rad=0.1).stereo_camera()


@given(st.floats(0.3, 6.0), st.floats(-2.0, 2.0), st.floats(-0.08, 1.5))
def test_projection_and_back_gives_the_same_point(x, y, z):
    point = np.array([[x + CAMERA.base_from_cam[0, 3], y, z]])
    u, v, d = CAMERA.pixel_from_base(point)
    np.testing.assert_allclose(CAMERA.base_from_pixel(u, v, d), point, atol=1e-9)


def test_depth_sigma_grows_with_the_square_of_depth():
    near, far = CAMERA.focal_px * CAMERA.baseline_m / np.array([1.0, 3.0])
    sigma = CAMERA.depth_sigma_m(np.array([near, far]), 0.3)
    np.testing.assert_allclose(sigma[1] / sigma[0], 9.0)
    np.testing.assert_allclose(sigma[0], 0.3 / (228.0 * 0.06))


def test_unknown_and_impossible_disparity_is_unknown_depth():
    assert np.isnan(CAMERA.depth_m(np.array([np.nan, 0.0, -1.0]))).all()


def test_points_behind_the_eye_have_no_pixel():
    u, v, d = CAMERA.pixel_from_base(np.array([[-1.0, 0.0, 0.1]]))
    assert np.isnan(u).all() and np.isnan(v).all() and np.isnan(d).all()


def test_level_camera_looks_forward_with_right_to_the_right():
    rotation = base_from_cam(0.1, 0.0, 0.09)[:3, :3]
    np.testing.assert_allclose(rotation @ [0, 0, 1], [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(rotation @ [1, 0, 0], [0, -1, 0], atol=1e-12)
    np.testing.assert_allclose(rotation @ [0, 1, 0], [0, 0, -1], atol=1e-12)


def test_pitch_turns_the_view_towards_the_floor():
    forward = base_from_cam(0.0, 0.0, 0.09, pitch_rad=0.2)[:3, 2]
    assert forward[2] < 0 < forward[0]
