"""Pictures of the built-in flat, shared by the tests of perception."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from robot.config import Config, PerceptionConfig
from robot.geometry.se2 import SE2, exp
from robot.geometry.stereo import StereoCamera
from robot.messages import StereoFrame
from robot.perception.chain import Perception
from robot.perception.depth import make_depth
from robot.sim.rig import StereoRig
from robot.sim.scene import load_scene
from robot.sim.world import World

CONFIG = Config()
CAMERA: StereoCamera = CONFIG.camera.stereo_camera()
FRAME_NS = 100_000_000


@lru_cache(maxsize=1)
def flat() -> World:
    return load_scene("flat")


@lru_cache(maxsize=1)
def _rig() -> StereoRig:
    return StereoRig(flat(), CAMERA, CONFIG.sim, seed=5)


@lru_cache(maxsize=64)
def view(seq: int, pose: SE2) -> tuple[StereoFrame, np.ndarray]:
    """The pair and its true disparity from a pose in scene coordinates."""
    return _rig().render(seq * FRAME_NS, seq, pose)


def drive(start: SE2, step: SE2, count: int) -> list[SE2]:
    """Poses of a drive of equal steps."""
    poses = [start]
    for _ in range(count - 1):
        poses.append(poses[-1] @ step)
    return poses


# Into the living room: a table, a shelf, pictures and the door.
DRIVE = drive(SE2(0.9, 1.1, 0.75), exp(0.025, 0.0, -0.02), 14)


def perception(**changes: object) -> Perception:
    """A fresh chain with changed keys of its configuration."""
    config = PerceptionConfig(**changes)  # type: ignore[arg-type]
    return Perception(config, CONFIG.robot, CAMERA, make_depth(config, CAMERA))
