"""A log of ours through the robot's own SLAM, without rendering or perception."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from robot.bench.slam_survey import NEES_BOUND
from robot.config import Config
from robot.evaluate.consistency import best_share_rmse_m, nees
from robot.evaluate.trajectory import associate, compare_tracks
from robot.log.reader import read_events, read_truth
from robot.messages import Event, ImuSample, Seen, WheelTravel
from robot.slam.slam import Slam


@dataclass(frozen=True, slots=True, eq=False)
class LogRun:
    """The row, the tracks (n, 4), and landmarks (k, 2) with covariances (k, 2, 2)."""

    row: dict[str, Any]
    track: np.ndarray
    truth: np.ndarray
    landmarks: tuple[np.ndarray, np.ndarray]


def measure_log(path: Path, config: Config) -> LogRun:
    """SLAM over the log's wheels, gyro and perceived frames, against the simulator's truth.

    Raises LogError for what is not a log.
    """
    slam = Slam(config.slam, config.robot)
    track, covs = _drive(slam, read_events(path), blind=False)
    blind, _ = _drive(Slam(config.slam, config.robot), read_events(path), blind=True)
    truth = np.array([(t * 1e-9, p.x_m, p.y_m, p.yaw_rad) for t, p in read_truth(path)]).reshape(
        -1, 4
    )
    landmarks = slam.landmarks()
    row: dict[str, Any] = {
        "name": f"{path.parent.name}_{path.stem}",
        "association": "unknown",
        **dict.fromkeys(("ate_rmse_m", "ate_best90_m", "start_rmse_m", "yaw_rmse_rad")),
        "landmark_rmse_m": None,  # nobody knows where a corner of a texture truly is
        "nees_mean": None,
        "nees_in_bound_pct": None,
        "landmarks": len(landmarks[0]),
        "wrong_association_pct": None,
        "dead_reckoning_ate_m": None,
    }
    error = compare_tracks(track, truth)
    if error is not None:
        kept = np.isin(track[:, 0], associate(track, truth)[0][:, 0])
        found, true = associate(track[kept], truth)
        values = nees(found, covs[kept], true, error.true_from_estimate)
        dead = compare_tracks(blind, truth)
        row |= {
            "ate_rmse_m": round(error.ate_rmse_m, 4),
            "ate_best90_m": round(best_share_rmse_m(found[:, 1:3], true[:, 1:3]), 4),
            "start_rmse_m": round(error.start_rmse_m, 4),
            "yaw_rmse_rad": round(error.yaw_rmse_rad, 4),
            "nees_mean": round(float(values.mean()), 3),
            "nees_in_bound_pct": round(100.0 * float((values <= NEES_BOUND).mean()), 2),
            "dead_reckoning_ate_m": round(dead.ate_rmse_m, 4) if dead else None,
        }
    return LogRun(row, track, truth, landmarks)


def _drive(slam: Slam, events: Iterable[Event], *, blind: bool) -> tuple[np.ndarray, np.ndarray]:
    """Track (n, 4) at the frames and covariances (n, 3, 3); `blind` sees no landmark."""
    track, covs = [], []
    for event in events:
        if isinstance(event, WheelTravel | ImuSample):
            slam.odometry(event)
        elif isinstance(event, Seen):
            seen = replace(event, landmarks=(), marker=None) if blind else event
            estimate = slam.see(seen)
            pose = estimate.world_from_base
            track.append((event.t_ns * 1e-9, pose.x_m, pose.y_m, pose.yaw_rad))
            covs.append(estimate.cov)
    return np.array(track).reshape(-1, 4), np.array(covs).reshape(-1, 3, 3)
