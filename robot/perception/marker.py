"""The dock's ArUco marker: found, measured with an honest covariance, and handed on.

The pose comes from the four corners of a square of known size (IPPE: Collins and Bartoli, IJCV
2014). A flat square seen nearly head-on has two likely poses; both are kept if the picture cannot
tell them apart, and then the yaw's variance says so.
"""

from __future__ import annotations

import math

import cv2
import numpy as np

from robot.config import PerceptionConfig, RobotConfig
from robot.geometry.se2 import SE2
from robot.geometry.stereo import StereoCamera
from robot.messages import Landmark, Marker

CORNER_SIGMA_PX = 0.25
FLOOR_SIGMA_M = 0.002  # mounting of camera and marker
FLOOR_SIGMA_RAD = 0.01
AMBIGUOUS = 2.0  # the second pose counts while its error is below this times the first one's
MAX_ERROR_PX = 1.5
MIN_SIDE_PX = 8.0
LANDMARK_BYTES = 32


class MarkerFinder:
    """Looks for one marker id of the dictionary 4x4_50."""

    def __init__(self, config: PerceptionConfig, robot: RobotConfig, camera: StereoCamera) -> None:
        self._camera, self._id = camera, robot.dock_marker_id
        self._every, self._wait = config.marker_every, 0
        half = 0.5 * robot.dock_marker_size_m
        self._corners_m = np.array(
            [[-half, half, 0.0], [half, half, 0.0], [half, -half, 0.0], [-half, -half, 0.0]]
        )
        self._matrix = np.array(
            [
                [camera.focal_px, 0.0, camera.cx_px],
                [0.0, camera.focal_px, camera.cy_px],
                [0.0, 0.0, 1.0],
            ]
        )
        options = cv2.aruco.DetectorParameters()
        options.adaptiveThreshWinSizeMin = options.adaptiveThreshWinSizeMax = 15
        options.minMarkerPerimeterRate = 4.0 * MIN_SIDE_PX / max(camera.width_px, camera.height_px)
        options.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
        options.cornerRefinementWinSize = 3
        options.relativeCornerRefinmentWinSize = 0.2
        self._detector = cv2.aruco.ArucoDetector(
            cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50), options
        )

    def find(self, left: np.ndarray) -> Marker | None:
        """The marker in a rectified grey uint8 image (h, w), or None.

        While none is in sight only every `marker_every`-th frame is searched.
        """
        if self._wait > 0:
            self._wait -= 1
            return None
        marker = self._search(left)
        self._wait = 0 if marker else self._every - 1
        return marker

    def _search(self, left: np.ndarray) -> Marker | None:
        quads, ids, _ = self._detector.detectMarkers(left)
        if ids is None:
            return None
        for quad, marker_id in zip(quads, ids.ravel().tolist(), strict=True):
            if marker_id == self._id:
                return self._measure(np.asarray(quad, np.float64).reshape(4, 2))
        return None

    def _measure(self, pixels: np.ndarray) -> Marker | None:
        _, rotations, shifts, errors = cv2.solvePnPGeneric(
            self._corners_m, pixels, self._matrix, None, flags=cv2.SOLVEPNP_IPPE_SQUARE
        )
        error = np.asarray(errors, float).ravel()
        if error[0] > MAX_ERROR_PX or shifts[0][2, 0] <= 0.0:
            return None
        pose = self._planar(rotations[0], shifts[0])
        cov = self._covariance(rotations[0], shifts[0])
        if len(error) > 1 and error[1] < max(AMBIGUOUS * error[0], CORNER_SIGMA_PX):
            other = self._planar(rotations[1], shifts[1])
            apart = math.remainder(other.yaw_rad - pose.yaw_rad, 2.0 * math.pi)
            cov[2, 2] += apart**2
        return Marker(self._id, pose, cov)

    def _planar(self, rotation: np.ndarray, shift: np.ndarray) -> SE2:
        """Marker's centre and outward direction in `base`, dropped to the floor."""
        mount = self._camera.base_from_cam
        base_from_face = mount[:3, :3] @ cv2.Rodrigues(rotation)[0]
        centre = mount[:3, :3] @ shift.ravel() + mount[:3, 3]
        out = base_from_face[:, 2]
        return SE2(float(centre[0]), float(centre[1]), math.atan2(out[1], out[0]))

    def _covariance(self, rotation: np.ndarray, shift: np.ndarray) -> np.ndarray:
        """Corner noise carried through the projection (Gauss-Newton information), then planar."""
        _, jacobian = cv2.projectPoints(self._corners_m, rotation, shift, self._matrix, None)
        jacobian = jacobian[:, :6]
        information = jacobian.T @ jacobian / CORNER_SIGMA_PX**2
        cov = np.linalg.inv(information + np.eye(6) * 1e-9)
        steps = np.eye(6) * 1e-5
        here = self._planar(rotation, shift)
        to_planar = np.empty((3, 6))
        for i, step in enumerate(steps):
            near = self._planar(rotation + step[:3, None], shift + step[3:, None])
            turned = math.remainder(near.yaw_rad - here.yaw_rad, 2.0 * math.pi)
            to_planar[:, i] = np.array([near.x_m - here.x_m, near.y_m - here.y_m, turned]) / 1e-5
        floor = np.diag([FLOOR_SIGMA_M**2, FLOOR_SIGMA_M**2, FLOOR_SIGMA_RAD**2])
        return to_planar @ cov @ to_planar.T + floor


def marker_landmark(marker: Marker) -> Landmark:
    """The marker's centre as a landmark that cannot be mistaken for another."""
    x, y = marker.base_from_marker.x_m, marker.base_from_marker.y_m
    range_m = math.hypot(x, y)
    to_polar = np.array([[x / range_m, y / range_m], [-y / range_m**2, x / range_m**2]])
    return Landmark(
        range_m,
        math.atan2(y, x),
        to_polar @ marker.cov[:2, :2] @ to_polar.T,
        bytes([marker.marker_id]).ljust(LANDMARK_BYTES, b"\0"),
        "marker",
        track_id=-1,
    )
