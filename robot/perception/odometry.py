"""Planar visual odometry: the one motion of the robot that explains how all points moved.

A point (u, v, d) seen now is lifted into `base`, moved by (x, y, yaw) into the previous `base` and
projected again; the differences to what was seen there, in pixels, are minimised by Gauss-Newton.
A shift of all rows goes with it, for no camera rides without nodding: a tenth of a degree looks
like millimetres of travel otherwise.
Outliers lose their weight by graduated non-convexity with Geman and McClure's loss (Yang et al.,
IEEE RA-L 2020), which needs no random samples.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from robot.geometry.se2 import SE2
from robot.geometry.stereo import StereoCamera
from robot.messages import VisualMotion
from robot.perception.point_stereo import Points

SIGMA_PX = np.array([0.2, 0.2, 0.3])  # of u, v and d, between two frames
WIDTHS = (64.0, 16.0, 8.0, 4.0, 3.0, 3.0, 3.0)  # of the loss, in sigma, from wide to narrow
OUTLIER_SIGMA = 3.5
MIN_INLIERS, MIN_SHARE = 8, 0.4
MIN_DISPARITY_PX = 1.5
FAR_PX = 0.2  # disparity assumed of points without: only turns move them
NOD_PX = 2.0  # one sigma of that shift (half a degree)
COV_FACTOR = 1.2  # neighbouring points share their errors
FLOOR_SIGMA = np.array([0.0005, 0.0005, 0.0005])  # m, m, rad
MAX_STEP_M, MAX_STEP_RAD = 0.3, 0.6  # between two frames: more is a mistake

_PRIOR = np.diag([1e-3, 1e-3, 1e-3, NOD_PX**-2])  # the pose's only keeps the equations solvable


@dataclass(frozen=True, slots=True, eq=False)
class _Pairs:
    now_m: np.ndarray  # (n, 3) in base
    before: np.ndarray  # (n, 3): u, v, d


class VisualOdometry:
    """Remembers the points of the last frame."""

    def __init__(self, camera: StereoCamera, max_step_m: float = MAX_STEP_M) -> None:
        self._camera, self._max_step_m = camera, max_step_m
        self._last: Points | None = None
        self._motion = SE2()

    def expected_motion(self, yaw_hint_rad: float) -> SE2:
        """Motion since the last frame as far as it can be guessed: as before, turning as told."""
        yaw = yaw_hint_rad if math.isfinite(yaw_hint_rad) else self._motion.yaw_rad
        return SE2(self._motion.x_m, self._motion.y_m, yaw)

    def expected_pixels(self, yaw_hint_rad: float) -> np.ndarray:
        """Where the last frame's points (n, 2) should be seen now; float32."""
        if self._last is None:
            return np.empty((0, 2), np.float32)
        pixel = self._last.pixel.astype(np.float64)
        depth_px = np.where(np.isfinite(self._last.disparity_px), self._last.disparity_px, FAR_PX)
        points = self._camera.base_from_pixel(pixel[:, 0], pixel[:, 1], depth_px)
        points[:, :2] = self.expected_motion(yaw_hint_rad).inverse().apply(points[:, :2])
        u, v, _ = self._camera.pixel_from_base(points)
        expected = np.stack([u, v], axis=1)
        return np.where(np.isfinite(expected), expected, pixel).astype(np.float32)

    def update(self, points: Points, yaw_hint_rad: float) -> tuple[VisualMotion | None, Points]:
        """Motion since the last frame, and the points, unsteady where they contradict it.

        The motion is None when too few points agree on one, and then nothing contradicts.
        `yaw_hint_rad` may be NaN: it is a start only.
        """
        last, self._last = self._last, points
        if last is None:
            return None, points
        index, pairs = self._pair(last, points)
        if len(index) < MIN_INLIERS:
            self._motion = SE2()
            return None, points
        guess = self.expected_motion(yaw_hint_rad)
        pose = np.array([guess.x_m, guess.y_m, guess.yaw_rad, 0.0])
        for width in WIDTHS:
            residual, jacobian = self._linearise(pose, pairs)
            chi2 = np.sum(residual**2, axis=1)
            weight = (width**2 / (width**2 + chi2)) ** 2
            weighted = (jacobian * weight[:, None, None]).reshape(-1, 4).T
            normal = weighted @ jacobian.reshape(-1, 4) + _PRIOR
            slope = weighted @ residual.reshape(-1)
            slope[3] += _PRIOR[3, 3] * pose[3]
            pose = pose - np.linalg.solve(normal, slope)
        residual, jacobian = self._linearise(pose, pairs)
        inlier = np.sum(residual**2, axis=1) < OUTLIER_SIGMA**2
        count = int(np.count_nonzero(inlier))
        moved = math.hypot(pose[0], pose[1])
        possible = moved < self._max_step_m and abs(pose[2]) < MAX_STEP_RAD
        if count < max(MIN_INLIERS, MIN_SHARE * len(index)) or not possible:
            self._motion = SE2()
            return None, points
        steady = points.steady.copy()
        steady[index[~inlier]] = False
        cov = self._covariance(residual[inlier], jacobian[inlier])
        self._motion = SE2(float(pose[0]), float(pose[1]), float(pose[2]))
        return VisualMotion(self._motion, cov, count), replace(points, steady=steady)

    def _pair(self, last: Points, now: Points) -> tuple[np.ndarray, _Pairs]:
        """Points with stereo in both frames: their index (n,) in `now`, and both sights."""
        _, old, new = np.intersect1d(
            last.track_id, now.track_id, assume_unique=True, return_indices=True
        )
        d_old, d_new = last.disparity_px[old], now.disparity_px[new]
        with np.errstate(invalid="ignore"):
            good = np.minimum(d_old, d_new) > MIN_DISPARITY_PX
        old, new = old[good], new[good]
        pixel = now.pixel[new].astype(np.float64)
        points = self._camera.base_from_pixel(pixel[:, 0], pixel[:, 1], now.disparity_px[new])
        before = np.column_stack([last.pixel[old].astype(np.float64), last.disparity_px[old]])
        return new, _Pairs(points.reshape(-1, 3), before)

    def _linearise(self, pose: np.ndarray, pairs: _Pairs) -> tuple[np.ndarray, np.ndarray]:
        """Residuals (n, 3) over sigma and their Jacobian (n, 3, 4) by x, y, yaw and the nod."""
        camera = self._camera
        x, y, yaw, nod_px = pose.tolist()
        c, s = math.cos(yaw), math.sin(yaw)
        turned = pairs.now_m @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        rotation, origin = camera.base_from_cam[:3, :3], camera.base_from_cam[:3, 3]
        cam = np.ascontiguousarray(((turned + np.array([x, y, 0.0]) - origin) @ rotation).T)
        z = np.maximum(cam[2], 0.05)
        focal, fb = camera.focal_px, camera.focal_px * camera.baseline_m
        u, v, d = focal * cam[0] / z, focal * cam[1] / z, fb / z
        residual = np.empty_like(pairs.before)
        for k, seen in enumerate((u + camera.cx_px, v + camera.cy_px + nod_px, d)):
            residual[:, k] = (seen - pairs.before[:, k]) / SIGMA_PX[k]
        # How the point moves in the camera frame, (axis, change, n), for x, y and yaw.
        across = np.column_stack([-turned[:, 1], turned[:, 0]]) @ rotation[:2]
        step = np.empty((3, 3, len(z)))
        step[:, :2] = rotation[:2].T[:, :, None]
        step[:, 2] = across.T
        away = step[2] / z
        jacobian = np.zeros((3, 4, len(z)))
        jacobian[0, :3] = (focal * step[0] / z - u * away) / SIGMA_PX[0]
        jacobian[1, :3] = (focal * step[1] / z - v * away) / SIGMA_PX[1]
        jacobian[2, :3] = -d * away / SIGMA_PX[2]
        jacobian[1, 3] = 1.0 / SIGMA_PX[1]
        return residual, np.ascontiguousarray(jacobian.transpose(2, 0, 1))

    def _covariance(self, residual: np.ndarray, jacobian: np.ndarray) -> np.ndarray:
        """Of (x, y, yaw): inverse information, scaled by what the residuals say about the noise."""
        rows = jacobian.reshape(-1, 4)
        information = rows.T @ rows + _PRIOR
        variance = max(1.0, float(np.mean(residual**2)))
        cov = np.linalg.inv(information)[:3, :3] * variance * COV_FACTOR
        return cov + np.diag(FLOOR_SIGMA**2)
