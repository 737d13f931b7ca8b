"""The floor plane follows a camera that is not mounted as drawn, and never runs away."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from perception_views import CAMERA, DRIVE, view

from robot.config import PerceptionConfig
from robot.geometry.stereo import StereoCamera, base_from_cam
from robot.perception.floor import MAX_HEIGHT_CHANGE, NOD_RAD, Floor, rows_above_near_floor

MAX_PX = 64
U = np.arange(CAMERA.width_px) - CAMERA.cx_px
V = np.arange(CAMERA.height_px) - CAMERA.cy_px


def disparity(pitch_rad: float, roll_rad: float, height_m: float) -> np.ndarray:
    """Endless floor seen by a camera pitched down, rolled, and at a height; NaN where none."""
    down = np.array(
        [
            math.sin(roll_rad) * math.cos(pitch_rad),
            math.cos(roll_rad) * math.cos(pitch_rad),
            math.sin(pitch_rad),
        ]
    )
    rays = down[0] * U[None] + down[1] * V[:, None] + down[2] * CAMERA.focal_px
    d = CAMERA.baseline_m / height_m * rays
    return np.where((d > 0.5) & (d < MAX_PX), d, np.nan).astype(np.float32)


@settings(max_examples=20, deadline=None)
@given(
    st.floats(math.radians(-0.4), math.radians(0.4)),
    st.floats(math.radians(-0.4), math.radians(0.4)),
    st.floats(0.087, 0.093),
)
def test_a_wrong_mounting_is_learnt(pitch: float, roll: float, height: float) -> None:
    floor = Floor(CAMERA)
    seen = disparity(pitch, roll, height)
    for _ in range(40):
        plane = floor.update(seen, MAX_PX)
    assert plane.height_m == pytest.approx(height, abs=0.001)
    off = plane.disparity_px(U[None], V[:, None]) - seen
    assert np.nanmax(np.abs(off)) < 0.35


def test_without_floor_the_plane_returns_to_the_mounting() -> None:
    floor = Floor(CAMERA)
    mounted = floor.plane
    for _ in range(20):
        floor.update(disparity(0.01, 0.0, 0.092), MAX_PX)
    assert abs(floor.plane.height_m - mounted.height_m) > 0.001
    nothing = np.full((CAMERA.height_px, CAMERA.width_px), np.nan, np.float32)
    for _ in range(120):
        plane = floor.update(nothing, MAX_PX)
    assert plane.height_m == pytest.approx(mounted.height_m, abs=1e-4)
    assert plane.slope_v == pytest.approx(mounted.slope_v, abs=1e-3)


@pytest.mark.parametrize("height_m", [0.05, 0.2])
def test_an_impossible_floor_is_not_followed_beyond_the_limits(height_m: float) -> None:
    floor = Floor(CAMERA)
    mounted = floor.plane
    for _ in range(50):
        plane = floor.update(disparity(0.0, 0.0, height_m), MAX_PX)
    assert abs(plane.slope_v / mounted.slope_v - 1.0) <= MAX_HEIGHT_CHANGE + 1e-9


def test_walls_furniture_and_rugs_hardly_tilt_the_floor() -> None:
    floor = Floor(CAMERA)
    for seq, pose in enumerate(DRIVE):
        _, truth = view(seq, pose)
        plane = floor.update(truth, MAX_PX)
    assert plane.height_m == pytest.approx(0.09, abs=0.002)
    horizon = -plane.offset_px / plane.slope_v
    assert abs(horizon) < 2.0
    assert abs(plane.slope_u) < 0.02 * plane.slope_v  # 20 mrad: a rug on one side


@pytest.mark.parametrize("pitch_deg", [-5.0, 0.0, 5.0])
@pytest.mark.parametrize("max_px", [48, 64])
def test_all_floor_that_can_be_matched_lies_in_the_rows_above_the_near_floor(
    pitch_deg: float, max_px: int
) -> None:
    mount = base_from_cam(0.13, 0.03, 0.09, math.radians(pitch_deg))
    camera = StereoCamera(320, 240, 228.0, 159.5, 119.5, 0.06, mount)
    rows = rows_above_near_floor(camera, PerceptionConfig(max_disparity_px=max_px))
    x_m = np.linspace(0.15, 4.0, 2000)
    floor = np.stack([x_m, np.zeros_like(x_m), np.zeros_like(x_m)], axis=1)
    _, v, d = camera.pixel_from_base(floor)
    matched = v[d <= max_px].max()
    assert matched + NOD_RAD * camera.focal_px < rows < matched + 12


def test_a_camera_that_sees_no_near_floor_keeps_all_rows() -> None:
    high = StereoCamera(320, 240, 228.0, 159.5, 119.5, 0.06, base_from_cam(0.0, 0.0, 1.0))
    assert rows_above_near_floor(high, PerceptionConfig()) == 240
