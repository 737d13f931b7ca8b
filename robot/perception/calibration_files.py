"""Readers for the calibration files that cameras and data sets come with, from text to numbers.

`parse_calibration` recognises the layout by its keys:
EuRoC ASL `sensor.yaml` (one file per eye), ROS `camera_info` YAML (one file per eye, as
camera_calibration writes them), Kalibr `camchain.yaml`, OpenCV FileStorage YAML, and KITTI
odometry `calib.txt` (already rectified).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from robot.errors import CalibrationError
from robot.perception.calibration import Eye, StereoCalibration, check_calibration

_PLAIN_MODELS = {"radtan", "radial-tangential", "plumb_bob", "rational_polynomial", "none", ""}


def parse_calibration(
    text: str,
    name: str = "calibration",
    right_text: str | None = None,
    right_name: str | None = None,
    size_px: tuple[int, int] | None = None,
) -> StereoCalibration:
    """Read a stereo calibration from the text of one file, or of one file per eye.

    `name` and `right_name` appear in error messages. `size_px` (width, height) is used by layouts
    that do not state it (KITTI). Raises CalibrationError for anything missing, malformed or
    impossible.
    """
    if right_text is not None:
        both = f"{name} and {right_name or 'the right file'}"
        left_reader = _Reader(_yaml(text, name), name)
        right_reader = _Reader(_yaml(right_text, right_name or "the right file"), right_name or "")
        parse = _euroc if "T_BS" in left_reader.table else _ros
        return check_calibration(parse(left_reader, right_reader, both))
    if any(line.startswith("P0:") for line in text.splitlines()):
        return check_calibration(_kitti(text, name, size_px))
    reader = _Reader(_yaml(text, name), name)
    if "cam0" in reader.table:
        return check_calibration(_kalibr(reader))
    for keys in _OPENCV_KEYS:
        if keys[0] in reader.table:
            return check_calibration(_opencv(reader, keys, size_px))
    if "T_BS" in reader.table or "camera_matrix" in reader.table:
        raise CalibrationError(
            f"{name}: describes one eye only; give the right eye's file as well."
        )
    raise CalibrationError(
        f"{name}: not a known stereo calibration; give EuRoC sensor.yaml or ROS camera_info YAML "
        "of both eyes, Kalibr camchain.yaml, OpenCV FileStorage YAML or KITTI calib.txt."
    )


class _Reader:
    """A table of one file whose every miss names the file and the key."""

    def __init__(self, table: dict[str, Any], name: str) -> None:
        self.table, self.name = table, name

    def fail(self, key: str, problem: str, remedy: str) -> CalibrationError:
        return CalibrationError(f"{self.name}: {key} {problem}; {remedy}.")

    def get(self, key: str) -> Any:
        if key not in self.table:
            raise self.fail(key, "is missing", "add it or calibrate again")
        return self.table[key]

    def has(self, key: str) -> bool:
        return key in self.table

    def sub(self, key: str) -> _Reader:
        value = self.get(key)
        if not isinstance(value, dict):
            raise self.fail(key, "is not a table", "see the layout its tool writes")
        return _Reader(value, f"{self.name}: {key}")

    def array(self, key: str, *shape: int) -> np.ndarray:
        """Numbers under `key`, plain or in a {rows, cols, data} table; a -1 takes what is there."""
        value = self.get(key)
        if isinstance(value, dict):
            value = value.get("data")
        try:
            flat = np.asarray(value, dtype=np.float64).ravel()
            return flat.reshape(shape)
        except (TypeError, ValueError):
            wanted = "x".join("n" if n < 0 else str(n) for n in shape)
            raise self.fail(key, f"is not {wanted} numbers", "correct that entry") from None

    def size(self, *keys: str) -> tuple[int, int]:
        values = [self.get(keys[0])] if len(keys) == 1 else [self.get(key) for key in keys]
        try:
            width, height = np.asarray(values).ravel().tolist()
            return int(width), int(height)
        except (TypeError, ValueError):
            raise self.fail(keys[0], "is not width and height", "correct that entry") from None


def _yaml(text: str, name: str) -> dict[str, Any]:
    """Parse YAML, also OpenCV's dialect of it (`%YAML:1.0`, `!!opencv-matrix`)."""
    import yaml

    class Loader(yaml.SafeLoader):
        pass

    def matrix(loader: Loader, node: yaml.MappingNode) -> dict[Any, Any]:
        return loader.construct_mapping(node, deep=True)

    Loader.add_constructor("tag:yaml.org,2002:opencv-matrix", matrix)
    lines = [line for line in text.splitlines() if not line.startswith("%YAML")]
    try:
        table = yaml.load("\n".join(lines), Loader=Loader)
    except yaml.YAMLError as error:
        what = " ".join(str(error).split())
        raise CalibrationError(f"{name}: not valid YAML ({what}); correct that line.") from None
    if not isinstance(table, dict):
        raise CalibrationError(f"{name}: holds no keys; give a calibration file.")
    return table


def _distortion(reader: _Reader, model_key: str, key: str) -> np.ndarray:
    model = str(reader.table.get(model_key, "")).lower()
    if model not in _PLAIN_MODELS:
        raise reader.fail(
            model_key, f"is {model!r}", "calibrate with the pinhole radial-tangential model"
        )
    values = reader.array(key, -1)
    if len(values) not in (0, 4, 5, 8):
        raise reader.fail(key, f"has {len(values)} numbers", "give 4, 5 or 8 coefficients")
    return values if len(values) else np.zeros(4)


def _intrinsics(values: np.ndarray) -> np.ndarray:
    fx, fy, cx, cy = values
    return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


def _euroc(left: _Reader, right: _Reader, name: str) -> StereoCalibration:
    """EuRoC ASL: T_BS is body_from_cam (Burri et al., IJRR 2016)."""
    eyes, poses = [], []
    for reader in (left, right):
        width, height = reader.size("resolution")
        distortion = _distortion(reader, "distortion_model", "distortion_coefficients")
        eyes.append(Eye(width, height, _intrinsics(reader.array("intrinsics", 4)), distortion))
        poses.append(reader.array("T_BS", 4, 4))
        if abs(np.linalg.det(poses[-1])) < 1e-6:
            raise reader.fail("T_BS", "is not a rigid transform", "correct that entry")
    return StereoCalibration(eyes[0], eyes[1], np.linalg.inv(poses[1]) @ poses[0], name)


def _ros(left: _Reader, right: _Reader, name: str) -> StereoCalibration:
    """ROS camera_info: the pair's geometry hides in the rectification and projection matrices.

    A rectified point is R_left x_left; in the right eye it is shifted by P_right[0, 3] / fx.
    """
    eyes = []
    for reader in (left, right):
        width, height = reader.size("image_width", "image_height")
        distortion = _distortion(reader, "distortion_model", "distortion_coefficients")
        eyes.append(Eye(width, height, reader.array("camera_matrix", 3, 3), distortion))
    rotations = [reader.array("rectification_matrix", 3, 3) for reader in (left, right)]
    projection = right.array("projection_matrix", 3, 4)
    if not projection[0, 0] > 0.0:
        raise right.fail("projection_matrix", "has no focal length", "calibrate as a stereo pair")
    if projection[0, 3] == 0.0:
        raise right.fail("projection_matrix", "has no baseline", "calibrate as a stereo pair")
    pose = np.eye(4)
    pose[:3, :3] = rotations[1].T @ rotations[0]
    pose[:3, 3] = rotations[1].T @ np.array([projection[0, 3] / projection[0, 0], 0.0, 0.0])
    return StereoCalibration(eyes[0], eyes[1], pose, name)


def _kalibr(reader: _Reader) -> StereoCalibration:
    """Kalibr camchain: cam1's T_cn_cnm1 is right_from_left."""
    eyes = []
    for key in ("cam0", "cam1"):
        eye = reader.sub(key)
        width, height = eye.size("resolution")
        distortion = _distortion(eye, "distortion_model", "distortion_coeffs")
        eyes.append(Eye(width, height, _intrinsics(eye.array("intrinsics", 4)), distortion))
    pose = reader.sub("cam1").array("T_cn_cnm1", 4, 4)
    return StereoCalibration(eyes[0], eyes[1], pose, reader.name)


# Names that OpenCV's own samples use: left matrix, left distortion, right matrix, right distortion.
_OPENCV_KEYS = (("M1", "D1", "M2", "D2"), ("K1", "D1", "K2", "D2"))


def _opencv(
    reader: _Reader, keys: tuple[str, str, str, str], size_px: tuple[int, int] | None
) -> StereoCalibration:
    """OpenCV FileStorage: R and T as stereoCalibrate returns them, `image_size` [w, h] or given."""
    if reader.has("image_size"):
        size_px = reader.size("image_size")
    elif reader.has("image_width"):
        size_px = reader.size("image_width", "image_height")
    elif size_px is None:
        raise reader.fail("image_size", "is missing", "add it as [width, height]")
    eyes = []
    for matrix, distortion in (keys[:2], keys[2:]):
        eyes.append(
            Eye(*size_px, reader.array(matrix, 3, 3), _distortion(reader, "model", distortion))
        )
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = reader.array("R", 3, 3), reader.array("T", 3)
    return StereoCalibration(eyes[0], eyes[1], pose, reader.name)


def _kitti(text: str, name: str, size_px: tuple[int, int] | None) -> StereoCalibration:
    """KITTI odometry: P0 and P1 of the rectified grey pair (Geiger et al., CVPR 2012)."""
    if size_px is None:
        raise CalibrationError(
            f"{name}: KITTI's calib.txt does not state the image size; give it with the images."
        )
    table: dict[str, Any] = {}
    for line in text.splitlines():
        key, colon, values = line.partition(":")
        if colon:
            table[key.strip()] = values.split()
    reader = _Reader(table, name)
    projections = [reader.array(key, 3, 4) for key in ("P0", "P1")]
    if not projections[1][0, 0] > 0.0:
        raise reader.fail("P1", "has no focal length", "give the data set's own calib.txt")
    eyes = [Eye(*size_px, projection[:, :3], np.zeros(4)) for projection in projections]
    pose = np.eye(4)
    pose[0, 3] = projections[1][0, 3] / projections[1][0, 0]
    return StereoCalibration(eyes[0], eyes[1], pose, name)
