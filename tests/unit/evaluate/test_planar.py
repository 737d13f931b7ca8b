"""A drive in a plane is recognised however the plane lies; a flight is not."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot.evaluate.planar import planar_track


def rotation(axis: str, angle: float) -> np.ndarray:
    c, s = math.cos(angle), math.sin(angle)
    pose = np.eye(4)
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    pose[i, i] = pose[j, j] = c
    pose[i, j], pose[j, i] = -s, s
    return pose


def drive(n: int = 80) -> np.ndarray:
    """An arc of 4 m with a wobble of half a degree."""
    poses = []
    pose = np.eye(4)
    for i in range(n):
        poses.append(pose @ rotation("x", 0.01 * math.sin(i)))
        step = rotation("z", 0.02)
        step[0, 3] = 0.05
        pose = pose @ step
    return np.array(poses)


T = np.arange(80) * 0.1


def test_a_drive_gives_its_track() -> None:
    track = planar_track(T, drive())
    assert track is not None
    np.testing.assert_allclose(track[:, 0], T)
    np.testing.assert_allclose(track[:, 1:3], drive()[:, :2, 3], atol=1e-3)
    np.testing.assert_allclose(track[:, 3], 0.02 * np.arange(80), atol=1e-3)


def test_the_frame_of_the_truth_does_not_matter() -> None:
    upside = rotation("y", 2.0) @ rotation("x", 1.0)
    upside[:3, 3] = 5.0, -7.0, 1.0
    track, other = planar_track(T, drive()), planar_track(T, upside @ drive())
    assert track is not None and other is not None
    np.testing.assert_allclose(other, track, atol=1e-9)


def test_a_slope_is_a_plane_too() -> None:
    # The first pose points up the slope by 5 degrees less than the rest of the drive.
    poses = drive()
    climbed = rotation("y", -0.09) @ poses
    climbed[0, :3, :3] = np.eye(3)
    track = planar_track(T, climbed)
    assert track is not None
    length = np.hypot(*np.diff(track[:, 1:3], axis=0).T).sum()
    assert length == pytest.approx(0.05 * 79, rel=1e-3)


@pytest.mark.parametrize("what", ["heave", "tilt", "still", "flight", "few"])
def test_other_motions_are_none(what: str) -> None:
    poses = drive()
    wave = np.sin(np.arange(80) * 0.3)
    if what == "heave":
        poses[:, 2, 3] += 0.2 * wave
    elif what == "tilt":
        poses = np.array([p @ rotation("y", 0.1 * w) for p, w in zip(poses, wave, strict=True)])
    elif what == "still":
        poses[:, :3, 3] *= 0.01
    elif what == "flight":
        poses[:, :3, 3] = np.random.default_rng(0).normal(0.0, 0.3, (80, 3))
    else:
        poses = poses[:2]
    assert planar_track(T[: len(poses)], poses) is None
