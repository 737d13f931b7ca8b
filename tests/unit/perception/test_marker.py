"""The dock's marker, seen by the simulated camera from where the robot approaches."""

from __future__ import annotations

import math

import numpy as np
import pytest
from perception_views import CAMERA, CONFIG, flat, view

from robot.config import PerceptionConfig
from robot.geometry.se2 import SE2
from robot.messages import Marker
from robot.perception.marker import MarkerFinder, as_landmark


def finder(**robot: object) -> MarkerFinder:
    from msgspec.structs import replace

    return MarkerFinder(PerceptionConfig(), replace(CONFIG.robot, **robot), CAMERA)


def found_from(pose_from_dock: SE2) -> tuple[Marker | None, SE2]:
    """What is found from a pose given relative to the docked one, and the truth in `base`."""
    pose = flat().start @ pose_from_dock
    frame, _ = view(900, pose)
    return finder().find(frame.left), pose.inverse() @ flat().dock


@pytest.mark.parametrize(
    "pose, position_m, yaw_rad",
    [
        (SE2(0.0, 0.0, 0.0), 0.004, 0.02),
        (SE2(-0.3, 0.03, 0.1), 0.01, 0.1),
        (SE2(-0.6, -0.1, -0.15), 0.02, 0.15),
        (SE2(-1.0, 0.2, 0.2), 0.05, 0.4),
    ],
)
def test_pose_of_the_marker(pose: SE2, position_m: float, yaw_rad: float) -> None:
    marker, truth = found_from(pose)
    assert marker is not None and marker.marker_id == CONFIG.robot.dock_marker_id
    seen = marker.base_from_marker
    assert seen.distance_m(truth) < position_m
    assert abs(math.remainder(seen.yaw_rad - truth.yaw_rad, 2 * math.pi)) < yaw_rad
    error = np.array(
        [
            seen.x_m - truth.x_m,
            seen.y_m - truth.y_m,
            math.remainder(seen.yaw_rad - truth.yaw_rad, 2 * math.pi),
        ]
    )
    assert error @ np.linalg.solve(marker.cov, error) < 16.3  # 0.1 % of honest sights


def test_uncertainty_grows_with_distance() -> None:
    near, far = (found_from(SE2(-back, 0.0, 0.0))[0] for back in (0.2, 1.0))
    assert near is not None and far is not None
    assert np.all(np.diag(far.cov) > np.diag(near.cov))


def test_another_number_is_not_the_dock() -> None:
    frame, _ = view(901, flat().start @ SE2(-0.4, 0.0, 0.0))
    assert finder().find(frame.left) is not None
    assert finder(dock_marker_id=8).find(frame.left) is None


def test_noise_and_blank_pictures_hold_no_marker() -> None:
    rng = np.random.default_rng(4)
    for picture in (rng.integers(0, 255, (240, 320)), np.full((240, 320), 128)):
        assert finder().find(picture.astype(np.uint8)) is None


def test_search_pauses_while_nothing_is_in_sight() -> None:
    frame, _ = view(902, flat().start @ SE2(-0.4, 0.0, 0.0))
    blank = np.full((240, 320), 128, np.uint8)
    eye = finder()
    assert eye.find(blank) is None
    looked = [eye.find(frame.left) is not None for _ in range(PerceptionConfig().marker_every)]
    assert looked[-1] and not any(looked[:-1])
    assert eye.find(frame.left) is not None  # in sight: every frame


def test_the_marker_as_a_landmark() -> None:
    marker, truth = found_from(SE2(-0.5, 0.05, 0.05))
    assert marker is not None
    landmark = as_landmark(marker, 17)
    assert landmark.kind == "marker" and landmark.track_id == 17
    assert landmark.signature[0] == CONFIG.robot.dock_marker_id
    assert len(landmark.signature) == 32
    assert landmark.range_m == pytest.approx(math.hypot(truth.x_m, truth.y_m), abs=0.02)
    assert landmark.bearing_rad == pytest.approx(math.atan2(truth.y_m, truth.x_m), abs=0.01)
    assert np.all(np.linalg.eigvalsh(landmark.cov) > 0)
