"""What a stereo calibration says, checked once so that nobody has to distrust it afterwards."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robot.errors import CalibrationError

BASELINE_RANGE_M = (0.005, 2.0)
_ORTHONORMAL = 1e-3  # published rotations carry few digits


@dataclass(frozen=True, slots=True, eq=False)
class Eye:
    """One camera before rectification: pinhole with radial-tangential distortion.

    `matrix` is (3, 3) in pixels, `distortion` (n,) in OpenCV's order k1 k2 p1 p2 [k3 [k4 k5 k6]].
    """

    width_px: int
    height_px: int
    matrix: np.ndarray
    distortion: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class StereoCalibration:
    """Both eyes and the (4, 4) transform `right_from_left` between their camera frames, metres."""

    left: Eye
    right: Eye
    right_from_left: np.ndarray
    name: str = "calibration"

    @property
    def baseline_m(self) -> float:
        """Distance between the two optical centres."""
        return float(np.linalg.norm(self.right_from_left[:3, 3]))


def check_calibration(calibration: StereoCalibration) -> StereoCalibration:
    """Return the calibration unchanged, or raise CalibrationError saying why it is impossible."""
    name, left, right = calibration.name, calibration.left, calibration.right
    for side, eye in (("left", left), ("right", right)):
        _check_eye(eye, side, name)
    if (left.width_px, left.height_px) != (right.width_px, right.height_px):
        raise CalibrationError(
            f"{name}: the left eye is {left.width_px}x{left.height_px} px and the right "
            f"{right.width_px}x{right.height_px} px; calibrate both eyes at the same size."
        )
    _check_extrinsics(calibration)
    return calibration


def _check_eye(eye: Eye, side: str, name: str) -> None:
    if eye.width_px < 16 or eye.height_px < 16:
        raise CalibrationError(
            f"{name}: the {side} eye's image size {eye.width_px}x{eye.height_px} px is impossible; "
            "give the size of the calibrated images."
        )
    numbers = np.concatenate([eye.matrix.ravel(), eye.distortion.ravel()])
    if not np.all(np.isfinite(numbers)):
        raise CalibrationError(
            f"{name}: the {side} eye has a number that is not finite; calibrate again."
        )
    fx, fy, cx, cy = eye.matrix[[0, 1, 0, 1], [0, 1, 2, 2]]
    longest = max(eye.width_px, eye.height_px)
    if not all(0.1 * longest < f < 20.0 * longest for f in (fx, fy)):
        raise CalibrationError(
            f"{name}: the {side} eye's focal length ({fx:g}, {fy:g}) px does not fit an image of "
            f"{eye.width_px}x{eye.height_px} px; check the intrinsics' unit (pixels) and order."
        )
    if not (0.0 < cx < eye.width_px and 0.0 < cy < eye.height_px):
        raise CalibrationError(
            f"{name}: the {side} eye's principal point ({cx:g}, {cy:g}) px lies outside the image; "
            "check the order of the intrinsics and the image size."
        )


def _check_extrinsics(calibration: StereoCalibration) -> None:
    name, pose = calibration.name, calibration.right_from_left
    rotation = pose[:3, :3]
    if not np.all(np.isfinite(pose)):
        raise CalibrationError(
            f"{name}: the extrinsics have a number that is not finite; calibrate again."
        )
    error = np.abs(rotation @ rotation.T - np.eye(3)).max()
    if error > _ORTHONORMAL or np.linalg.det(rotation) < 0.0:
        raise CalibrationError(
            f"{name}: the rotation between the eyes is not a rotation (off by {error:.2g}); "
            "check the order and sign of the extrinsics' numbers."
        )
    low, high = BASELINE_RANGE_M
    if not low <= calibration.baseline_m <= high:
        raise CalibrationError(
            f"{name}: the baseline is {calibration.baseline_m:g} m, outside {low:g} to {high:g} m; "
            "give translations in metres."
        )
    right_eye = -rotation.T @ pose[:3, 3]  # where the right eye stands, seen by the left one
    if right_eye[0] <= 0.0:
        raise CalibrationError(
            f"{name}: the baseline is negative ({right_eye[0]:g} m): the right eye stands left of "
            "the left one; swap the two cameras."
        )
    if abs(right_eye[1]) > right_eye[0]:
        raise CalibrationError(
            f"{name}: the eyes stand above each other rather than side by side; "
            "only a horizontal pair can be rectified, check the axes of the extrinsics."
        )
