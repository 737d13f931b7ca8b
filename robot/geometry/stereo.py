"""Rectified stereo: pixels, disparity, depth and its uncertainty.

The error of stereo lives in disparity, so depth and its sigma are always derived:
z = f b / d and sigma_z = z^2 sigma_d / (f b)  (Matthies and Shafer, IEEE J. Robot. Autom. 1987).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class StereoCamera:
    """A rectified pair. Both eyes share focal length and principal point.

    `base_from_cam` is a (4, 4) homogeneous transform; `cam` is the left eye with x right, y down,
    z forward, and `base` the axle centre on the floor (REP-103).
    """

    width_px: int
    height_px: int
    focal_px: float
    cx_px: float
    cy_px: float
    baseline_m: float
    base_from_cam: np.ndarray

    def depth_m(self, disparity_px: np.ndarray) -> np.ndarray:
        """Depth along z; NaN where the disparity is unknown or not positive."""
        d = np.where(disparity_px > 0, disparity_px, np.nan)
        return self.focal_px * self.baseline_m / d

    def depth_sigma_m(self, disparity_px: np.ndarray, sigma_px: float) -> np.ndarray:
        """Standard deviation of depth for a disparity error of `sigma_px`."""
        return self.depth_m(disparity_px) ** 2 * sigma_px / (self.focal_px * self.baseline_m)

    def cam_from_pixel(self, u_px: np.ndarray, v_px: np.ndarray, d_px: np.ndarray) -> np.ndarray:
        """Points (..., 3) in `cam`, metres, for pixels with disparity."""
        z = self.depth_m(d_px)
        x = (u_px - self.cx_px) * z / self.focal_px
        y = (v_px - self.cy_px) * z / self.focal_px
        return np.stack([x, y, z], axis=-1)

    def base_from_pixel(self, u_px: np.ndarray, v_px: np.ndarray, d_px: np.ndarray) -> np.ndarray:
        """Points (..., 3) in `base`, metres, for pixels with disparity."""
        points = self.cam_from_pixel(u_px, v_px, d_px)
        return points @ self.base_from_cam[:3, :3].T + self.base_from_cam[:3, 3]

    def pixel_from_base(self, points_m: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Project points (..., 3) of `base` to (u_px, v_px, disparity_px); NaN behind the eye."""
        rotation, origin = self.base_from_cam[:3, :3], self.base_from_cam[:3, 3]
        cam = (points_m - origin) @ rotation
        z = np.where(cam[..., 2] > 1e-6, cam[..., 2], np.nan)
        u = self.focal_px * cam[..., 0] / z + self.cx_px
        v = self.focal_px * cam[..., 1] / z + self.cy_px
        return u, v, self.focal_px * self.baseline_m / z


def base_from_cam(x_m: float, y_m: float, z_m: float, pitch_rad: float = 0.0) -> np.ndarray:
    """Mounting of the left eye at (x, y, z) in `base`, pitched down by `pitch_rad`."""
    c, s = np.cos(pitch_rad), np.sin(pitch_rad)
    forward, right = np.array([c, 0.0, -s]), np.array([0.0, -1.0, 0.0])
    down = np.cross(forward, right)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, down, forward], axis=1)
    pose[:3, 3] = x_m, y_m, z_m
    return pose
