"""The floor as a plane, found again in every frame.

In the camera frame the floor is {X : n . X = h} with unit normal n (down) and height h. With
X = (u - cx, v - cy, f) z / f and z = f b / d it is linear in pixels: its disparity at (u, v) is

    d_floor = (b / h) (n_x (u - cx) + n_y (v - cy) + n_z f)

(the v-disparity idea of Labayrade et al., IV 2002, with roll), and a pixel of disparity d shows a
point at height h (1 - d_floor / d) above the floor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robot.config import PerceptionConfig
from robot.geometry.stereo import StereoCamera

MAX_TILT_RAD = math.radians(3.0)  # of the mounting, about either axis
MAX_HEIGHT_CHANGE = 0.15  # relative
SIGMA_PX = 0.5  # of one disparity
GATE_PX = 1.5
GATE_OF_D = 0.05  # a wrong height or pitch shows most where the floor is near
FORGET = 0.9  # per frame
PRIOR_TILT_RAD = math.radians(0.5)
PRIOR_HEIGHT = 0.05
STEP_PX = 4  # every fourth row and column is plenty
MIN_PIXELS = 60
NOD_RAD = math.radians(1.0)  # of a robot that drives over a sill


def rows_above_near_floor(camera: StereoCamera, config: PerceptionConfig) -> int:
    """Rows from the top, below which even the floor is too near to be matched.

    What stands on it is nearer still. A nod of the robot is allowed for.
    """
    slope_u, slope_v, offset_px = mounted_plane(camera).tolist()
    aside_px = abs(slope_u) * max(camera.cx_px, camera.width_px - 1 - camera.cx_px)
    v = (config.max_disparity_px + aside_px - offset_px) / max(slope_v, 1e-6)
    rows = math.ceil(v + camera.cy_px + NOD_RAD * camera.focal_px) + 1
    return min(max(rows, 1), camera.height_px)


def mounted_plane(camera: StereoCamera) -> np.ndarray:
    """Slope along u, slope along v and offset (3,) of the floor's disparity, by the mounting."""
    rotation, height = camera.base_from_cam[:3, :3], camera.base_from_cam[2, 3]
    normal = -rotation[2]  # base's downward axis, seen in the camera frame
    return camera.baseline_m / height * normal * np.array([1.0, 1.0, camera.focal_px])


@dataclass(frozen=True, slots=True, eq=False)
class FloorPlane:
    """d_floor = slope_u (u - cx) + slope_v (v - cy) + offset; `height_m` is the eye's height."""

    slope_u: float
    slope_v: float
    offset_px: float
    height_m: float

    def disparity_px(self, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Disparity of the floor at pixels relative to the principal point."""
        return self.slope_u * u + self.slope_v * v + self.offset_px


class Floor:
    """Refines pitch, roll and height of the camera, within limits, from what looks like floor."""

    def __init__(self, camera: StereoCamera) -> None:
        self._camera = camera
        self._mounted = mounted_plane(camera)
        prior_sigma = self._prior_sigma()
        self._prior = np.diag(prior_sigma**-2.0)
        self._information = np.zeros((3, 3))
        self._vector = np.zeros(3)  # both relative to the mounting
        self._change = np.zeros(3)
        self._u = np.arange(0, camera.width_px, STEP_PX) - camera.cx_px
        self._v = np.arange(0, camera.height_px, STEP_PX) - camera.cy_px

    @property
    def plane(self) -> FloorPlane:
        """The plane as known now."""
        slope_u, slope_v, offset = (self._mounted + self._change).tolist()
        focal, baseline = self._camera.focal_px, self._camera.baseline_m
        height = baseline / math.sqrt(slope_u**2 + slope_v**2 + (offset / focal) ** 2)
        return FloorPlane(slope_u, slope_v, offset, height)

    def update(self, disparity_px: np.ndarray, max_disparity_px: float) -> FloorPlane:
        """Look for floor in the disparity (h, w) and return the refined plane.

        Weighted least squares over pixels near the plane of the frame before, remembered over
        about 1 / (1 - FORGET) frames, with the mounting as prior. Without floor in sight the
        plane falls back towards the mounting. Errors of the mounting of about half a degree or
        3 mm are learnt; worse ones lie outside the gate and must be corrected in the camera's keys.
        """
        seen = disparity_px[::STEP_PX, ::STEP_PX]
        u, v = np.broadcast_arrays(self._u[None, :], self._v[:, None])
        expected = self.plane.disparity_px(u, v)
        with np.errstate(invalid="ignore"):
            near = np.abs(seen - expected) < GATE_PX + GATE_OF_D * expected
        near &= (expected > 0.5) & (expected < max_disparity_px - GATE_PX)
        self._information *= FORGET
        self._vector *= FORGET
        if np.count_nonzero(near) >= MIN_PIXELS:
            rows = np.stack([u[near], v[near], np.ones(np.count_nonzero(near))])
            away = seen[near] - self._mounted @ rows
            # A neighbourhood shares its error: count the pixels as if there were a few only.
            weight = MIN_PIXELS / rows.shape[1] / SIGMA_PX**2
            self._information += weight * (rows @ rows.T)
            self._vector += weight * (rows @ away)
        self._change = self._limited(np.linalg.solve(self._information + self._prior, self._vector))
        return self.plane

    def _prior_sigma(self) -> np.ndarray:
        scale = self._camera.baseline_m / self._camera.base_from_cam[2, 3]
        return np.array(
            [
                scale * PRIOR_TILT_RAD,
                scale * PRIOR_HEIGHT,
                scale * self._camera.focal_px * PRIOR_TILT_RAD,
            ]
        )

    def _limited(self, change: np.ndarray) -> np.ndarray:
        scale = self._camera.baseline_m / self._camera.base_from_cam[2, 3]
        limit = scale * np.array(
            [MAX_TILT_RAD, MAX_HEIGHT_CHANGE, self._camera.focal_px * MAX_TILT_RAD]
        )
        return np.clip(change, -limit, limit)
