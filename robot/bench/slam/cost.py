"""What a predict and an update cost beside filterpy's own, in one process, taking turns."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from robot.geometry.se2 import SE2
from robot.slam.ekf import CALIBRATION, FIRST_LANDMARK, POSE, LandmarkFilter
from robot.slam.motion import compose
from robot.slam.sensor import expected

SIZES = (100, 200, 400)
_ROUNDS, _IN_A_ROW = 5, 5
_NOISE = np.diag([0.01, 0.02]) ** 2


def measure_cost(sizes: tuple[int, ...] = SIZES) -> list[dict[str, Any]]:
    """Medians in microseconds of one range-bearing update and one predict, ours and filterpy's.

    Ours is the invariant filter that the robot runs; each step is called several times in a row,
    the four of them taking turns.
    """
    return [_row(count) for count in sizes]


def _row(count: int) -> dict[str, Any]:
    ours = _full_filter(count)
    dense = _dense(ours)
    end, by_pose, by_increment = compose(ours.x[POSE], SE2(0.01, 0.0, 0.002))
    by_calibration = by_increment @ np.full((3, 4), 0.001)
    noise, walk = np.diag([1e-8, 1e-8, 1e-9]), np.full(4, 1e-12)
    dense.F[POSE, POSE], dense.F[POSE, CALIBRATION] = by_pose, by_calibration
    dense.Q[POSE, POSE] = noise
    seen, h = np.array([count // 2]), np.zeros((2, ours.dim_x))
    predicted, at_pose, at_point = expected(ours.x[POSE], ours.landmarks()[seen])
    first = FIRST_LANDMARK + 2 * int(seen[0])
    columns = np.array([[0, 1, 2, first, first + 1]])
    jacobian = np.concatenate([at_pose, at_point], axis=2)
    h[:, columns[0]] = jacobian[0]
    away = np.array([[0.002, 0.001]])
    steps: dict[str, Callable[[], object]] = {
        "update_us": lambda: ours.update(columns, jacobian, away, _NOISE[None]),
        "predict_us": lambda: ours.predict(end, by_pose, by_calibration, noise, walk),
        "filterpy_update_us": lambda: dense.update(
            predicted[0] + away[0], lambda x: h, lambda x: predicted[0], R=_NOISE
        ),
        "filterpy_predict_us": dense.predict,
    }
    times: dict[str, list[float]] = {name: [] for name in steps}
    for _ in range(_ROUNDS):
        for name, step in steps.items():
            for _ in range(_IN_A_ROW):
                began = time.perf_counter()
                step()
                times[name].append(1e6 * (time.perf_counter() - began))
    median = {name: round(statistics.median(spent), 1) for name, spent in times.items()}
    return {
        "landmarks": count,
        **median,
        "update_ratio": round(median["filterpy_update_us"] / median["update_us"], 1),
        "predict_ratio": round(median["filterpy_predict_us"] / median["predict_us"], 1),
    }


def _full_filter(count: int) -> LandmarkFilter:
    """A filter of `count` landmarks, all correlated."""
    rng = np.random.default_rng(count)
    ours = LandmarkFilter(np.full(FIRST_LANDMARK, 0.1), invariant=True)
    one = np.tile(np.eye(2), (count, 1, 1))
    ours.add(rng.uniform(-10, 10, (count, 2)), np.zeros((count, 2, 3)), one, one)
    root = rng.normal(0.0, 0.1, (ours.dim_x, 16))
    ours.P = root @ root.T / 16.0 + 1e-4 * np.eye(ours.dim_x)
    return ours


def _dense(ours: LandmarkFilter) -> Any:
    """filterpy's own filter in the same state."""
    from filterpy.kalman import ExtendedKalmanFilter

    dense = ExtendedKalmanFilter(ours.dim_x, 2)
    dense.x, dense.P = ours.x.copy(), ours.P.copy()
    dense.F = np.eye(ours.dim_x)
    dense.Q = np.zeros_like(ours.P)
    return dense
