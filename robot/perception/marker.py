"""The dock's ArUco marker (Garrido-Jurado et al., Pattern Recognition 2014) and its pose.

The marker hangs upright, so only four numbers are unknown: place (x, y), height and yaw. They are
fitted to the eight corner coordinates, which leaves no room for the flips of a free 3-D pose.
"""

from __future__ import annotations

import math

import cv2
import numpy as np

from robot.config import PerceptionConfig, RobotConfig
from robot.geometry.se2 import SE2
from robot.geometry.stereo import StereoCamera
from robot.messages import Landmark, Marker
from robot.perception.quad import sharpen_quad

SIGMA_PX = 0.3  # of one corner coordinate
MAX_ERROR_PX = 1.5  # root mean square of the fit
MIN_SIDE_PX = 7.0
ITERATIONS = 7
STEP = 1e-5  # m and rad, for the numeric Jacobian
ENOUGH = 1e-5  # m and rad: a fit that moves less is finished
STARTS_RAD = (0.0, 0.6, -0.6)  # yaw away from facing the camera
COMMON_SIGMA = np.array([0.003, 0.003, 0.01])  # print size, flatness, mounting


class MarkerFinder:
    """Looks for one marker; every frame while it is in sight, more rarely otherwise."""

    def __init__(self, config: PerceptionConfig, robot: RobotConfig, camera: StereoCamera) -> None:
        parameters = cv2.aruco.DetectorParameters()
        # One threshold window instead of three: the marker is seen large or not needed.
        parameters.adaptiveThreshWinSizeMin = parameters.adaptiveThreshWinSizeMax = 11
        dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
        self._detector = cv2.aruco.ArucoDetector(dictionary, parameters)
        self._id, self._side_m = robot.dock_marker_id, robot.dock_marker_size_m
        self._camera, self._every = camera, config.marker_every
        self._wait = 0

    def find(self, left: np.ndarray) -> Marker | None:
        """The marker in a rectified grey image (h, w); None if not found, or not looked for."""
        if self._wait > 0:
            self._wait -= 1
            return None
        corners, ids, _ = self._detector.detectMarkers(left)
        if ids is not None:
            for quad, marker_id in zip(corners, np.ravel(ids), strict=True):
                sharp = sharpen_quad(left, quad.reshape(4, 2).astype(np.float64))
                marker = self._locate(sharp, int(marker_id))
                if marker is not None:
                    return marker
        self._wait = self._every - 1
        return None

    def _locate(self, quad: np.ndarray, marker_id: int) -> Marker | None:
        if marker_id != self._id or np.linalg.norm(quad[2] - quad[0]) < 1.4 * MIN_SIDE_PX:
            return None
        fits = [self._fit(self._start(quad, turn), quad) for turn in STARTS_RAD]
        fits = [fit for fit in fits if math.isfinite(fit[1])]
        if not fits or min(error for _, error, _ in fits) > MAX_ERROR_PX:
            return None
        pose, cov = _merge(fits)
        yaw = math.remainder(float(pose[2]), 2.0 * math.pi)
        return Marker(marker_id, SE2(float(pose[0]), float(pose[1]), yaw), cov)

    def _start(self, quad: np.ndarray, turn_rad: float) -> np.ndarray:
        """(x, y, z, yaw) of a marker of that image size, turned so much from facing the camera."""
        camera = self._camera
        height_px = 0.5 * (quad[3, 1] - quad[0, 1] + quad[2, 1] - quad[1, 1])
        depth_px = camera.baseline_m * max(height_px, 1.0) / self._side_m  # as a disparity
        middle = quad.mean(axis=0)
        place = camera.base_from_pixel(middle[0], middle[1], np.array(depth_px))
        toward = camera.base_from_cam[:3, 3] - place
        return np.array([*place, math.atan2(toward[1], toward[0]) + turn_rad])

    def _fit(self, pose: np.ndarray, quad: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
        """Gauss-Newton on the corners: pose (4,), error per coordinate in px, information."""
        nearby = np.vstack([np.zeros(4), STEP * np.eye(4)])
        error = math.inf
        for _ in range(ITERATIONS):
            seen = self._project(pose + nearby).reshape(5, 8)
            residual = quad.ravel() - seen[0]
            error = math.sqrt(float(np.mean(residual**2)))
            if not math.isfinite(error):
                return pose, math.inf, np.eye(4)
            jacobian = (seen[1:] - seen[0]).T / STEP
            information = jacobian.T @ jacobian + 1e-6 * np.eye(4)
            change = np.linalg.solve(information, jacobian.T @ residual)
            pose = pose + change
            if np.abs(change).max() < ENOUGH:
                break
        return pose, error, information

    def _project(self, poses: np.ndarray) -> np.ndarray:
        """Pixels (k, 4, 2) of the corners (top left, top right, bottom right, bottom left)."""
        half, yaw = 0.5 * self._side_m, poses[:, 3]
        # Seen from the front, the marker's left is along (sin, -cos) of its outward yaw.
        left = np.stack([np.sin(yaw), -np.cos(yaw), np.zeros_like(yaw)], axis=1) * half
        up = np.array([0.0, 0.0, half])
        corners = np.stack([left + up, up - left, -left - up, left - up], axis=1)
        u, v, _ = self._camera.pixel_from_base(poses[:, None, :3] + corners)
        return np.stack([u, v], axis=-1)


def _merge(fits: list[tuple[np.ndarray, float, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    """One (x, y, yaw) and covariance for all fits, weighed by how well they explain the corners.

    A small marker that turns to the left looks like one that turns to the right: both fits are
    kept then, and the covariance spans them.
    """
    errors = np.array([error for _, error, _ in fits])
    weight = np.exp(-0.5 * 8.0 * (errors**2 - errors.min() ** 2) / SIGMA_PX**2)
    weight /= weight.sum()
    poses = np.array([pose for pose, _, _ in fits])[:, [0, 1, 3]]
    best = int(np.argmin(errors))
    poses[:, 2] = poses[best, 2] + _wrapped(poses[:, 2] - poses[best, 2])
    mean = weight @ poses
    cov = np.diag(COMMON_SIGMA**2)
    for share, pose, (_, error, information) in zip(weight, poses, fits, strict=True):
        if share > 0.0:
            own = np.linalg.inv(information)[np.ix_([0, 1, 3], [0, 1, 3])]
            away = pose - mean
            cov += share * (own * max(SIGMA_PX, error) ** 2 + np.outer(away, away))
    return mean, cov


def _wrapped(angle_rad: np.ndarray) -> np.ndarray:
    return (angle_rad + np.pi) % (2.0 * np.pi) - np.pi


def as_landmark(marker: Marker, track_id: int) -> Landmark:
    """The marker's place as a landmark; its signature is its number, little-endian."""
    x, y = marker.base_from_marker.x_m, marker.base_from_marker.y_m
    range_m = math.hypot(x, y)
    polar = np.array([[x / range_m, y / range_m], [-y / range_m**2, x / range_m**2]])
    return Landmark(
        range_m=range_m,
        bearing_rad=math.atan2(y, x),
        cov=polar @ marker.cov[:2, :2] @ polar.T,
        signature=marker.marker_id.to_bytes(32, "little"),
        kind="marker",
        track_id=track_id,
    )
