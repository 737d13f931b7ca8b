"""The stereo camera on the simulated robot: two eyes with the faults of cheap ones."""

from __future__ import annotations

import math

import numpy as np

from robot.config import SimConfig
from robot.geometry.se2 import SE2
from robot.geometry.stereo import StereoCamera
from robot.messages import StereoFrame
from robot.sim.renderer import Renderer
from robot.sim.world import World


class StereoRig:
    """Takes pictures of a world. The same seed and sequence number give the same noise."""

    def __init__(self, world: World, camera: StereoCamera, sim: SimConfig, seed: int) -> None:
        self._camera, self._sim, self._seed = camera, sim, seed
        self._renderer = Renderer(world.mesh, world.atlas, camera.width_px, camera.height_px)
        rng = np.random.default_rng([seed, 23])
        self._exposure = 1.0 + float(rng.uniform(-sim.exposure_difference, sim.exposure_difference))
        self._shift_px = float(rng.uniform(-sim.vertical_shift_px, sim.vertical_shift_px))
        v, u = np.mgrid[0 : camera.height_px, 0 : camera.width_px]
        off_axis2 = ((u - camera.cx_px) ** 2 + (v - camera.cy_px) ** 2) / camera.focal_px**2
        self._vignette = (1.0 - sim.vignetting * off_axis2).astype(np.float32)

    def render(self, t_ns: int, seq: int, world_from_base: SE2) -> tuple[StereoFrame, np.ndarray]:
        """The pair seen from a pose (scene coordinates), and the left eye's true disparity.

        Disparity is float32 (h, w), NaN where nothing is seen.
        """
        camera = self._camera
        left_pose = planar_to_space(world_from_base) @ camera.base_from_cam
        right_pose = left_pose.copy()
        right_pose[:3, 3] += left_pose[:3, 0] * camera.baseline_m
        left, inverse_depth = self._renderer.render(
            left_pose, camera.focal_px, camera.cx_px, camera.cy_px
        )
        right, _ = self._renderer.render(
            right_pose, camera.focal_px, camera.cx_px, camera.cy_px + self._shift_px
        )
        rng = np.random.default_rng([self._seed, 29, seq])
        disparity = camera.focal_px * camera.baseline_m * inverse_depth
        disparity[inverse_depth <= 0] = np.nan
        frame = StereoFrame(
            t_ns, seq, self._expose(left, 1.0, rng), self._expose(right, self._exposure, rng)
        )
        return frame, disparity

    def _expose(self, light: np.ndarray, gain: float, rng: np.random.Generator) -> np.ndarray:
        noise = rng.standard_normal(light.shape, dtype=np.float32)
        grey = light * (gain * self._vignette) + self._sim.image_noise * noise
        return np.clip(np.rint(grey), 0, 255).astype(np.uint8)


def planar_to_space(pose: SE2) -> np.ndarray:
    """A planar pose as a (4, 4) transform on the floor."""
    c, s = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    space = np.eye(4)
    space[:2, :2] = [[c, -s], [s, c]]
    space[:2, 3] = pose.x_m, pose.y_m
    return space
