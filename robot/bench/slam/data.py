"""Range-bearing recordings of other robots, read for `sweeper bench slam`.

Every recording comes with what its kind of base and sensor is known to do (`SurveySettings`);
nothing in this file was fitted to a recording.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from robot.errors import DataError
from robot.slam.survey import SurveySettings
from robot.slam.survey.velocity import VelocityNoise

_ROBOTS = 5  # MRCLAM's subjects 1 to 5 are other robots, which move
_VICTORIA_L_M, _VICTORIA_H_M = 2.83, 0.76  # the Ackermann vehicle of Nebot and Guivant
_VICTORIA_LASER_M = (3.78, 0.5)
_STEP_S = 1.0  # the course's log has steps instead of times


@dataclass(frozen=True, slots=True, eq=False)
class SurveyData:
    """One recording. Truth rows are (t_s, x_m, y_m, yaw_rad), yaw NaN where nobody knew it."""

    name: str
    orders: np.ndarray  # (n, 3): t_s, v_mps, yaw_rate_radps
    sight_t_s: np.ndarray  # (m,), ascending
    polar: np.ndarray  # (m, 2): range_m, bearing_rad in the base
    subject: np.ndarray  # (m,) what was seen, -1 unknown
    truth: np.ndarray  # (k, 4)
    landmarks: dict[int, tuple[float, float]]  # true places by subject
    settings: SurveySettings
    truth_at_m: tuple[float, float] = (0.0, 0.0)  # point of the base that the truth follows


# A small differential drive of which only the orders are known, not what the wheels did: a tenth
# of a metre's way and a fifth of a radian's turn are doubtful. Its camera reads bar codes: their
# height in the image gives the range, so that the inverse range has a constant error.
CREATE = SurveySettings(
    noise=VelocityNoise(0.10, 0.10, 0.20, 0.01),
    range_m=0.02,
    inverse_range_per_m=0.01,
    bearing_rad=0.01,
)
# A car on grass with a laser scanner that sees trunks.
CAR = SurveySettings(
    noise=VelocityNoise(0.05, 0.02, 0.10, 0.05),
    range_m=0.2,
    inverse_range_per_m=0.0,
    bearing_rad=0.02,
    curvature_sigma=0.01,
)
# A simulated robot whose odometry is measured at the wheels.
COURSE = SurveySettings(
    noise=VelocityNoise(0.05, 0.05, 0.10, 0.01),
    range_m=0.1,
    inverse_range_per_m=0.0,
    bearing_rad=0.05,
    lag_sigma_s=0.0,
)


def find_surveys(path: Path) -> list[Callable[[], SurveyData]]:
    """Readers of every recording at or under `path`. Raises DataError where there is none."""
    if not path.exists():
        raise DataError(f"{path}: does not exist; give a recording or a folder of them.")
    if path.is_file():
        return [_reader(path)]
    raw = sorted(p.parent for p in path.rglob("Landmark_Groundtruth.dat"))
    found = [(folder, number) for folder in raw for number in _raw_robots(folder)]
    readers: list[Callable[[], SurveyData]] = [
        partial(read_mrclam_raw, folder, number) for folder, number in found
    ]
    files = sorted(p for p in path.rglob("*") if p.suffix == ".npz")
    files += sorted(path.rglob("sensor_data*.dat"))
    return readers + [_reader(file) for file in files]


def _reader(file: Path) -> Callable[[], SurveyData]:
    if file.suffix == ".npz":
        return partial(read_npz, file)
    if file.suffix == ".dat":
        return partial(read_course, file)
    raise DataError(
        f"{file}: not a recording; give .npz (MRCLAM, Victoria Park), sensor_data.dat, an MRCLAM "
        "folder or a log.mcap."
    )


def read_npz(file: Path) -> SurveyData:
    """MRCLAM (odo, z, gt, landmarks) or Victoria Park (control, trees, gps) arrays."""
    try:
        with np.load(file, allow_pickle=False) as loaded:
            arrays = {key: np.asarray(loaded[key], dtype=float) for key in loaded.files}
    except (OSError, ValueError) as error:
        raise DataError(f"{file}: cannot be read as .npz; download it again.") from error
    if {"odo", "z", "gt", "landmarks"} <= arrays.keys():
        return _mrclam(file.stem, arrays["odo"], arrays["z"], arrays["gt"], arrays["landmarks"])
    if {"control", "trees", "gps"} <= arrays.keys():
        return _victoria(f"victoria_{file.stem}", arrays)
    raise DataError(
        f"{file}: has {', '.join(sorted(arrays))}; it needs odo, z, gt and landmarks (MRCLAM) or "
        "control, trees and gps (Victoria Park)."
    )


def read_mrclam_raw(folder: Path, robot: int) -> SurveyData:
    """One robot of a raw MRCLAM folder: Robot1_Odometry.dat and so on."""
    odometry = _table(folder / f"Robot{robot}_Odometry.dat", 3)
    sights = _table(folder / f"Robot{robot}_Measurement.dat", 4)
    truth = _table(folder / f"Robot{robot}_Groundtruth.dat", 4)
    landmarks = _table(folder / "Landmark_Groundtruth.dat", 3)
    barcodes = {int(code): int(subject) for subject, code in _table(folder / "Barcodes.dat", 2)}
    sights[:, 1] = [barcodes.get(int(code), -1) for code in sights[:, 1]]
    start_s = odometry[0, 0]
    for rows in (odometry, sights, truth):
        rows[:, 0] -= start_s
    return _mrclam(f"{folder.name}_robot{robot}", odometry, sights, truth, landmarks[:, :3])


def read_course(file: Path) -> SurveyData:
    """The Freiburg course's log: ODOMETRY r1 t r2, then SENSOR id range bearing.

    True places and poses are taken from the world and true_data files of the same ending.
    """
    ending = file.stem.removeprefix("sensor_data")
    orders: list[tuple[float, float, float]] = []
    sights: list[tuple[float, float, float, float]] = []
    steps = 0
    for number, line in enumerate(_lines(file), start=1):
        kind, *words = line.split() or ["ODOMETRY"]
        try:
            first, second, third = (float(word) for word in words)
        except ValueError as error:
            raise DataError(f"{file}, line {number}: give three numbers after {kind}.") from error
        if kind == "ODOMETRY":
            start_s, piece_s = steps * _STEP_S, _STEP_S / 3.0
            orders += [
                (start_s, 0.0, _wrapped(first) / piece_s),
                (start_s + piece_s, second / piece_s, 0.0),
                (start_s + 2.0 * piece_s, 0.0, _wrapped(third) / piece_s),
            ]
            steps += 1
        elif kind == "SENSOR":
            sights.append((steps * _STEP_S, first, second, third))
        else:
            raise DataError(f"{file}, line {number}: {kind} is neither ODOMETRY nor SENSOR.")
    truth_file = file.with_name(f"true_data{ending}.dat")
    truth = _table(truth_file, 3) if truth_file.exists() else np.empty((0, 3))
    t_s = _STEP_S * np.arange(1, len(truth) + 1)
    world_file = file.with_name(f"world{ending}.dat")
    world = _table(world_file, 3) if world_file.exists() else np.empty((0, 3))
    z = np.array(sights).reshape(-1, 4)
    return SurveyData(
        f"course{ending}",
        np.array(orders),
        z[:, 0],
        z[:, 2:],
        z[:, 1].astype(int),
        np.column_stack([t_s, truth]),
        {int(i): (x, y) for i, x, y in world[:, :3].tolist()},
        COURSE,
    )


def _mrclam(
    name: str, odometry: np.ndarray, z: np.ndarray, truth: np.ndarray, landmarks: np.ndarray
) -> SurveyData:
    z = z[(z[:, 1] > _ROBOTS) & (z[:, 2] > 0.0)]
    z = z[np.argsort(z[:, 0], kind="stable")]
    return SurveyData(
        name,
        odometry[:, :3],
        z[:, 0],
        z[:, 2:4],
        z[:, 1].astype(int),
        truth,
        {int(i): (x, y) for i, x, y in landmarks[:, :3].tolist()},
        CREATE,
    )


def _victoria(name: str, arrays: dict[str, np.ndarray]) -> SurveyData:
    control, trees, gps = arrays["control"], arrays["trees"], arrays["gps"]
    steering = np.tan(control[:, 2])
    speed = control[:, 1] / (1.0 - steering * _VICTORIA_H_M / _VICTORIA_L_M)
    orders = np.column_stack([control[:, 0], speed, speed * steering / _VICTORIA_L_M])
    angle = trees[:, 2] - 0.5 * np.pi
    x = _VICTORIA_LASER_M[0] + trees[:, 1] * np.cos(angle)
    y = _VICTORIA_LASER_M[1] + trees[:, 1] * np.sin(angle)
    return SurveyData(
        name,
        orders,
        trees[:, 0],
        np.column_stack([np.hypot(x, y), np.arctan2(y, x)]),
        np.full(len(trees), -1),
        np.column_stack([gps, np.full(len(gps), np.nan)]),
        {},
        CAR,
        _VICTORIA_LASER_M,  # the antenna stands above the laser
    )


def _raw_robots(folder: Path) -> list[int]:
    names = [p.name for p in folder.glob("Robot*_Measurement.dat")]
    return sorted(int(name[len("Robot") :].split("_")[0]) for name in names)


def _table(file: Path, columns: int) -> np.ndarray:
    """Numbers of a text file with `#` comments: the first `columns` of each row."""
    rows = []
    for number, line in enumerate(_lines(file), start=1):
        words = line.split("#")[0].split()
        if not words:
            continue
        try:
            rows.append([float(word) for word in words[:columns]])
        except ValueError as error:
            raise DataError(f"{file}, line {number}: not numbers; restore the file.") from error
        if len(words) < columns:
            raise DataError(f"{file}, line {number}: needs {columns} numbers; restore the file.")
    return np.array(rows, dtype=float).reshape(-1, columns)


def _lines(file: Path) -> list[str]:
    try:
        return file.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f"{file}: cannot be read; restore the file.") from error


def _wrapped(angle_rad: float) -> float:
    return float((angle_rad + np.pi) % (2.0 * np.pi) - np.pi)
