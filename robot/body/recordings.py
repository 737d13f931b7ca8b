"""Folders of recorded stereo as others lay them out: EuRoC ASL and KITTI odometry.

EuRoC ASL (Burri et al., IJRR 2016): `mav0/cam0`, `mav0/cam1`, each with `data.csv`, `sensor.yaml`
and images in `data/`; optional `mav0/imu0` and `mav0/state_groundtruth_estimate0`.
KITTI odometry (Geiger et al., CVPR 2012): `image_0`, `image_1`, `times.txt`, `calib.txt`; optional
`poses.txt`. Images may be of any kind that OpenCV reads, grey or colour.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from robot.body.recording_files import (
    images_by_stem,
    parse_rows,
    read_grey,
    read_table,
    read_text,
)
from robot.errors import CalibrationError, FrameError
from robot.perception.calibration import StereoCalibration
from robot.perception.calibration_files import parse_calibration

MAX_SHUTTER_GAP_NS = 2_000_000  # left and right stamped further apart are no pair
KITTI_CAMERA_HEIGHT_M = 1.65


@dataclass(frozen=True, slots=True)
class PairFiles:
    """One instant of a recording; an eye that was not recorded is None."""

    t_ns: int
    left: Path | None
    right: Path | None


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """What a folder holds.

    `pairs` stand in the order of the folder's list. `gyro` is (n, 4) of t_s after the first pair
    and turn rates about the left camera's axes in rad/s, `truth` (n, 4, 4) poses of the left camera
    in a fixed frame at `truth_t_ns`; both may be empty. `camera_height_m` is None where the format
    does not tell.
    """

    name: str
    path: Path
    pairs: tuple[PairFiles, ...]
    calibration: StereoCalibration
    gyro: np.ndarray
    truth_t_ns: np.ndarray
    truth: np.ndarray
    camera_height_m: float | None = None


def find_recordings(paths: Iterable[Path]) -> list[Path]:
    """Every recording among the folders, or directly inside one of them, by name.

    Raises FrameError for a folder that is missing or holds none.
    """
    found: list[Path] = []
    for path in paths:
        if not path.is_dir():
            raise FrameError(f"{path}: no such folder; give folders of recorded stereo frames.")
        inside = [path] if _kind(path) else [p for p in sorted(path.iterdir()) if _kind(p)]
        if not inside:
            raise FrameError(
                f"{path}: holds neither EuRoC ASL (mav0/cam0) nor KITTI odometry (image_0) frames; "
                "give such a folder, or a folder of them."
            )
        found += inside
    return found


def open_recording(path: Path) -> Recording:
    """Read everything but the images.

    Raises FrameError for missing or malformed lists, CalibrationError for a calibration that is
    missing or unfit; images are read later, one by one.
    """
    kind = _kind(path)
    if kind is None:
        find_recordings([path])  # says what is wrong
        raise FrameError(f"{path}: holds recordings; open one of them.")
    recording = _open_euroc(path) if kind == "euroc" else _open_kitti(path)
    if not any(pair.left and pair.right for pair in recording.pairs):
        raise FrameError(f"{path}: not one image pair is there; copy the images beside their list.")
    return recording


def _kind(path: Path) -> str | None:
    if any((folder / "cam0").is_dir() for folder in (path / "mav0", path)):
        return "euroc"
    return "kitti" if (path / "image_0").is_dir() else None


# ---------------------------------------------------------------- EuRoC ASL


def _open_euroc(path: Path) -> Recording:
    root = path / "mav0" if (path / "mav0").is_dir() else path
    eyes = [root / "cam0", root / "cam1"]
    sensors = [eye / "sensor.yaml" for eye in eyes]
    texts = [read_text(sensor, CalibrationError, "the eye's calibration") for sensor in sensors]
    calibration = parse_calibration(
        texts[0], str(sensors[0]), right_text=texts[1], right_name=str(sensors[1])
    )
    pairs = _pair_up(*(_euroc_images(eye) for eye in eyes))
    body_from_cam = _body_from_sensor(texts[0])
    truth_t_ns, truth = _euroc_truth(root, body_from_cam)
    return Recording(
        name=path.name,
        path=path,
        pairs=pairs,
        calibration=calibration,
        gyro=_euroc_gyro(root / "imu0", body_from_cam, pairs[0].t_ns if pairs else 0),
        truth_t_ns=truth_t_ns,
        truth=truth,
    )


def _euroc_images(eye: Path) -> list[tuple[int, Path | None]]:
    """Stamps and files in the order of `data.csv`; a listed file may have another extension."""
    table = eye / "data.csv"
    by_stem = images_by_stem(eye / "data")
    images: list[tuple[int, Path | None]] = []
    for number, line in enumerate(
        read_text(table, FrameError, "the list of frames").splitlines(), 1
    ):
        words = [word.strip() for word in line.split(",")]
        if not words[0] or words[0].startswith("#"):
            continue
        try:
            images.append((int(words[0]), by_stem.get(Path(words[1]).stem)))
        except (ValueError, IndexError):
            raise FrameError(
                f"{table}, line {number}: not `timestamp [ns],filename`; correct that line."
            ) from None
    return images


def _pair_up(
    left: list[tuple[int, Path | None]], right: list[tuple[int, Path | None]]
) -> tuple[PairFiles, ...]:
    """Left frames with the right frame of the same instant; then the lonely right ones."""
    stamps = np.array([t_ns for t_ns, _ in right], dtype=np.int64)
    order = np.argsort(stamps, kind="stable")
    used: set[int] = set()
    pairs = []
    for t_ns, image in left:
        index = _nearest(stamps, order, t_ns)
        partner = None
        if index is not None and abs(int(stamps[index]) - t_ns) <= MAX_SHUTTER_GAP_NS:
            partner = right[index][1]
            used.add(index)
        pairs.append(PairFiles(t_ns, image, partner))
    pairs += [PairFiles(t, None, image) for i, (t, image) in enumerate(right) if i not in used]
    return tuple(pairs)


def _nearest(stamps: np.ndarray, order: np.ndarray, t_ns: int) -> int | None:
    if stamps.size == 0:
        return None
    place = int(np.searchsorted(stamps, t_ns, sorter=order))
    around = [int(order[i]) for i in (place - 1, place) if 0 <= i < stamps.size]
    return min(around, key=lambda i: abs(int(stamps[i]) - t_ns))


def _euroc_gyro(imu: Path, body_from_cam: np.ndarray, start_ns: int) -> np.ndarray:
    """(n, 4): seconds after `start_ns`, and turn rates about the left camera's axes."""
    if not (imu / "data.csv").is_file():
        return np.empty((0, 4))
    stamps, rows = read_table(imu / "data.csv", 7)
    sensor = imu / "sensor.yaml"
    body_from_imu = _body_from_sensor(sensor.read_text()) if sensor.is_file() else np.eye(4)
    rates = rows[:, :3] @ body_from_imu[:3, :3].T @ body_from_cam[:3, :3]
    return np.column_stack([(stamps - start_ns) * 1e-9, rates])


def _euroc_truth(root: Path, body_from_cam: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Stamps and poses of the left camera from the body's position and quaternion (w x y z)."""
    table = root / "state_groundtruth_estimate0" / "data.csv"
    if not table.is_file():
        return np.empty(0, np.int64), np.empty((0, 4, 4))
    stamps, rows = read_table(table, 8)
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3, :3] = _rotations(rows[:, 3:7])
    poses[:, :3, 3] = rows[:, :3]
    return stamps, poses @ body_from_cam


def _rotations(wxyz: np.ndarray) -> np.ndarray:
    """Rotation matrices (n, 3, 3) of quaternions (n, 4)."""
    w, x, y, z = (wxyz / np.linalg.norm(wxyz, axis=1, keepdims=True)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def _body_from_sensor(text: str) -> np.ndarray:
    """T_BS of a sensor.yaml; the identity if it has none."""
    import yaml

    lines = [line for line in text.splitlines() if not line.startswith("%")]
    table: Any = yaml.safe_load("\n".join(lines)) or {}
    data = table.get("T_BS", {}).get("data", np.eye(4))
    return np.array(data, dtype=float).reshape(4, 4)


# ---------------------------------------------------------------- KITTI odometry


def _open_kitti(path: Path) -> Recording:
    left, right = (images_by_stem(path / folder) for folder in ("image_0", "image_1"))
    times = path / "times.txt"
    seconds = [
        row[0] for row in parse_rows(times, read_text(times, FrameError, "the list of times"), 1)
    ]
    stamps = [round(t * 1e9) for t in seconds]
    pairs = [
        PairFiles(stamps[index], left.get(stem), right.get(stem))
        for index, stem in _numbered(sorted(left.keys() | right.keys()), len(stamps), times)
    ]
    poses = path / "poses.txt"
    truth = np.empty((0, 4, 4))
    if poses.is_file():
        text = read_text(poses, FrameError, "the truth")
        rows = np.array(parse_rows(poses, text, 12)).reshape(-1, 3, 4)[: len(stamps)]
        truth = np.tile(np.eye(4), (len(rows), 1, 1))
        truth[:, :3] = rows
    calib = path / "calib.txt"
    text = read_text(calib, CalibrationError, "the camera's calibration")
    return Recording(
        name=path.name,
        path=path,
        pairs=tuple(pairs),
        calibration=parse_calibration(text, str(calib), size_px=_first_size(path, left)),
        gyro=np.empty((0, 4)),
        truth_t_ns=np.array(stamps[: len(truth)], dtype=np.int64),
        truth=truth,
        camera_height_m=KITTI_CAMERA_HEIGHT_M,
    )


def _numbered(stems: list[str], times: int, table: Path) -> list[tuple[int, str]]:
    """The line of `times.txt` of each image: its number, or its place if an excerpt kept names.

    A number within the excerpt that has no image is a lost frame, under its own stem.
    """
    if len(stems) > times:
        raise FrameError(
            f"{table}: {times} times for {len(stems)} images; give one line for each image."
        )
    if not all(stem.isdecimal() and int(stem) < times for stem in stems):
        return list(enumerate(stems))
    by_number = {int(stem): stem for stem in stems}
    last = max(by_number, default=-1)
    return [(number, by_number.get(number, "")) for number in range(last + 1)]


def _first_size(path: Path, images: dict[str, Path]) -> tuple[int, int]:
    for file in images.values():
        image = read_grey(file)
        if image is not None:
            return image.shape[1], image.shape[0]
    raise FrameError(f"{path}: not one image can be read; copy the images into image_0.")
