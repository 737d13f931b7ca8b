"""A log of ours through the robot's own brain, without rendering or perception.

The whole brain, as what the map knows of matter also tells a robot where it is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from robot.bench.slam.survey import NEES_BOUND
from robot.body.replayed import brain_of
from robot.config import Config
from robot.evaluate.consistency import best_share_rmse_m, nees
from robot.evaluate.trajectory import associate, compare_tracks
from robot.geometry.se2 import SE2
from robot.log.codec import TruePose
from robot.log.reader import LogReader
from robot.messages import ImuSample, MapReport, PoseEstimate, Seen, WheelTravel
from robot.slam.slam import Slam

_TELL_EVERY_NS = 60_000_000_000


@dataclass(frozen=True, slots=True, eq=False)
class LogRun:
    """The row, the tracks (n, 4), and landmarks (k, 2) with covariances (k, 2, 2)."""

    row: dict[str, Any]
    track: np.ndarray
    truth: np.ndarray
    landmarks: tuple[np.ndarray, np.ndarray]


def measure_log(
    path: Path, config: Config | None = None, tell: Callable[[str], None] | None = None
) -> LogRun:
    """What the brain makes of the log's events, against the simulator's truth.

    It begins with the map that the robot began with; `config` instead of the log's own.
    The log is read once; `tell` hears every minute of it.
    NEES is taken from the start pose: there the robot's frame begins, with hardly a doubt.
    Raises LogError for what is not a log, ConfigError or MapError for what it began with.
    """
    track, covs, blind, truth, landmarks = _drive(path, config, tell or (lambda _: None))
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
        start = SE2(*true[0, 1:].tolist()) @ SE2(*found[0, 1:].tolist()).inverse()
        values = nees(found, covs[kept], true, start)
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


def _drive(
    path: Path, config: Config | None, tell: Callable[[str], None]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, tuple[np.ndarray, np.ndarray]]:
    """Track (n, 4) at the frames, covariances (n, 3, 3), that of odometry alone, truth, map."""
    track: list[tuple[float, ...]] = []
    dead: list[tuple[float, ...]] = []
    truth: list[tuple[float, ...]] = []
    covs = []
    landmarks = np.zeros((0, 2)), np.zeros((0, 2, 2))
    told_ns = 0
    with LogReader(path) as log:
        config = config or log.header.config()
        brain = brain_of(log.header, str(path), config)
        blind = Slam(config.slam, config.robot)
        for entry in log.entries(("event", "truth")):
            message = log.decoded(entry)
            if isinstance(message, TruePose):
                truth.append(_row(message.t_ns, message.world_from_base))
                continue
            for answer in brain.on(message):
                if isinstance(answer, PoseEstimate):
                    track.append(_of(answer))
                    covs.append(answer.cov)
                elif isinstance(answer, MapReport):
                    landmarks = answer.landmarks_m, answer.landmark_cov
            if isinstance(message, WheelTravel | ImuSample):
                blind.odometry(message)
            elif isinstance(message, Seen):
                dead.append(_of(blind.see(replace(message, landmarks=(), marker=None))))
                if message.t_ns - told_ns >= _TELL_EVERY_NS:
                    told_ns = message.t_ns
                    tell(f"{path.parent.name}: {told_ns // _TELL_EVERY_NS} min")
    tracks = [np.array(rows).reshape(-1, 4) for rows in (track, dead, truth)]
    return tracks[0], np.array(covs).reshape(-1, 3, 3), tracks[1], tracks[2], landmarks


def _of(estimate: PoseEstimate) -> tuple[float, ...]:
    return _row(estimate.t_ns, estimate.world_from_base)


def _row(t_ns: int, pose: SE2) -> tuple[float, ...]:
    return t_ns * 1e-9, pose.x_m, pose.y_m, pose.yaw_rad
