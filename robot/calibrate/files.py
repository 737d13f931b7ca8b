"""Writers of calibration files; `robot.perception.calibration_files` reads each of them back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from robot.errors import CalibrationError
from robot.perception.calibration import StereoCalibration

FORMATS = ("opencv", "kalibr", "ros")


@dataclass(frozen=True, slots=True)
class Provenance:
    """When and how well it was calibrated; goes into the file."""

    date: str  # ISO 8601, UTC
    rms_px: float
    epipolar_px: float


def write_calibration(
    calibration: StereoCalibration, layout: str, provenance: Provenance | None = None
) -> list[str]:
    """Texts of the file, or of the left and the right one (ros)."""
    if layout == "opencv":
        return [_opencv(calibration, provenance)]
    if layout == "kalibr":
        return [_kalibr(calibration)]
    if layout == "ros":
        return _ros(calibration)
    raise CalibrationError(f"'{layout}' is no layout; choose one of {', '.join(FORMATS)}.")


def _numbers(values: np.ndarray) -> str:
    return "[ " + ", ".join(repr(float(v)) for v in np.ravel(values)) + " ]"


def _opencv(calibration: StereoCalibration, provenance: Provenance | None) -> str:
    """FileStorage YAML with the names that OpenCV's stereo sample uses."""
    left, right, pose = calibration.left, calibration.right, calibration.right_from_left
    lines = ["%YAML:1.0", "---"]
    if provenance is not None:
        lines += [
            f'calibration_date: "{provenance.date}"',
            f"rms_px: {provenance.rms_px:.4f}",
            f"epipolar_px: {provenance.epipolar_px:.4f}",
        ]
    lines.append(f"image_size: [ {left.width_px}, {left.height_px} ]")
    matrices = {
        "M1": left.matrix, "D1": left.distortion[None, :],
        "M2": right.matrix, "D2": right.distortion[None, :],
        "R": pose[:3, :3], "T": pose[:3, 3:4],
    }  # fmt: skip
    for name, matrix in matrices.items():
        rows, columns = matrix.shape
        lines += [
            f"{name}: !!opencv-matrix", f"   rows: {rows}", f"   cols: {columns}", "   dt: d",
            f"   data: {_numbers(matrix)}",
        ]  # fmt: skip
    return "\n".join(lines) + "\n"


def _kalibr(calibration: StereoCalibration) -> str:
    """camchain.yaml; Kalibr's radtan model has four coefficients."""
    lines = []
    for key, eye in (("cam0", calibration.left), ("cam1", calibration.right)):
        if np.any(np.abs(eye.distortion[4:]) > 0.0):
            raise CalibrationError(
                f"{calibration.name}: Kalibr's radtan model has no k3, which this calibration "
                "uses; write the opencv or ros layout."
            )
        matrix = eye.matrix
        intrinsics = np.array([matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]])
        lines += [
            f"{key}:", "  camera_model: pinhole", f"  intrinsics: {_numbers(intrinsics)}",
            "  distortion_model: radtan", f"  distortion_coeffs: {_numbers(eye.distortion[:4])}",
            f"  resolution: [{eye.width_px}, {eye.height_px}]",
        ]  # fmt: skip
        if key == "cam1":
            lines.append("  T_cn_cnm1:")
            lines += [f"  - {_numbers(row)}" for row in calibration.right_from_left]
    return "\n".join(lines) + "\n"


def _ros(calibration: StereoCalibration) -> list[str]:
    """camera_info of both eyes, with the rectification that `stereoRectify` finds."""
    left, right = calibration.left, calibration.right
    pose = calibration.right_from_left
    size = (left.width_px, left.height_px)
    r_left, r_right, p_left, p_right, *_ = cv2.stereoRectify(
        left.matrix, left.distortion, right.matrix, right.distortion, size,
        pose[:3, :3], pose[:3, 3:4], flags=cv2.CALIB_ZERO_DISPARITY, alpha=0.0,
    )  # fmt: skip
    texts = []
    for name, eye, rotation, projection in (
        ("left", left, r_left, p_left),
        ("right", right, r_right, p_right),
    ):
        long = len(eye.distortion) > 5
        tables: dict[str, Any] = {
            "camera_matrix": eye.matrix,
            "distortion_coefficients": eye.distortion[None, :],
            "rectification_matrix": rotation,
            "projection_matrix": projection,
        }
        lines = [
            f"image_width: {eye.width_px}", f"image_height: {eye.height_px}",
            f"camera_name: {name}",
            f"distortion_model: {'rational_polynomial' if long else 'plumb_bob'}",
        ]  # fmt: skip
        for key, matrix in tables.items():
            rows, columns = matrix.shape
            lines += [
                f"{key}:",
                f"  rows: {rows}",
                f"  cols: {columns}",
                f"  data: {_numbers(matrix)}",
            ]
        texts.append("\n".join(lines) + "\n")
    return texts
