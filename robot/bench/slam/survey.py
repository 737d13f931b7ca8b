"""Runs a range-bearing recording through the filter and measures what came out."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from robot.bench.slam.data import SurveyData
from robot.evaluate.consistency import (
    AssociationTally,
    best_share_rmse_m,
    chi2_quantile,
    nees,
)
from robot.evaluate.trajectory import TrackError, compare_tracks
from robot.geometry.se2 import SE2
from robot.slam.survey import Survey

TRUTH_EVERY_S = 0.4  # the pose is asked for so often; truth is often denser
NEES_BOUND = chi2_quantile(3, 0.95)


@dataclass(frozen=True, slots=True, eq=False)
class SurveyRun:
    """Tracks at the times of the truth (those asked for), and the map at the end."""

    track: np.ndarray  # (n, 4)
    covs: np.ndarray  # (n, 3, 3)
    truth: np.ndarray  # (n, 4)
    blind: np.ndarray  # (n, 4) by the orders alone
    landmarks: np.ndarray  # (k, 2)
    landmark_covs: np.ndarray  # (k, 2, 2)
    names: list[int]
    tally: AssociationTally
    calibration: np.ndarray  # (4,)


def run_survey(data: SurveyData, named: bool) -> SurveyRun:
    """The whole recording, in order of time; `named`: the filter is told what it sees."""
    survey = Survey(data.settings, data.orders, named)
    blind = Survey(data.settings, data.orders, named)
    tally = AssociationTally()
    truth = _thinned(data.truth)
    cuts = np.flatnonzero(np.diff(data.sight_t_s, prepend=-np.inf, append=np.inf))
    frames = {float(data.sight_t_s[a]): slice(a, b) for a, b in pairwise(cuts)}
    asked = truth[:, 0] if len(truth) else np.array(sorted(frames))
    wanted = set(asked.tolist())
    track, covs, dead = [], [], []
    for t_s in sorted(wanted | frames.keys()):
        survey.move(t_s)
        blind.move(t_s)
        rows = frames.get(t_s)
        if rows is not None:
            subject = data.subject[rows]
            tally.count(survey.see(data.polar[rows], subject).tolist(), subject.tolist())
        if t_s in wanted:
            pose, cov = survey.pose()
            track.append((t_s, *_at(pose, data.truth_at_m)))
            covs.append(cov)
            dead.append((t_s, *_at(blind.pose()[0], data.truth_at_m)))
    names, landmarks, landmark_covs = survey.map()
    return SurveyRun(
        np.array(track).reshape(-1, 4),
        np.array(covs).reshape(-1, 3, 3),
        truth,
        np.array(dead).reshape(-1, 4),
        landmarks,
        landmark_covs,
        names,
        tally,
        survey.ekf.calibration.copy(),
    )


def _at(pose: np.ndarray, point_m: tuple[float, float]) -> tuple[float, float, float]:
    """The pose (3,) of `point_m` of the base."""
    there = SE2(*pose.tolist()) @ SE2(*point_m)
    return there.x_m, there.y_m, there.yaw_rad


def measure_survey(data: SurveyData, run: SurveyRun, named: bool) -> dict[str, Any]:
    """The row of one recording; figures without truth are None."""
    error = _error(run.track, run.truth)
    heading_known = len(run.truth) > 0 and bool(np.isfinite(run.truth[:, 3]).all())
    values = (
        nees(run.track, run.covs, run.truth, error.true_from_estimate)
        if error is not None and heading_known
        else None
    )
    blind = _error(run.blind, run.truth)
    identified = bool((data.subject >= 0).all())
    return {
        "name": data.name,
        "association": "known" if named else "unknown",
        "ate_rmse_m": _rounded(error.ate_rmse_m if error else None),
        "ate_best90_m": _rounded(
            best_share_rmse_m(run.track[:, 1:3], run.truth[:, 1:3]) if error else None
        ),
        "start_rmse_m": _rounded(error.start_rmse_m if error and heading_known else None),
        "yaw_rmse_rad": _rounded(error.yaw_rmse_rad if error and heading_known else None),
        "landmark_rmse_m": _rounded(
            _landmark_rmse_m(data, run, error.true_from_estimate) if error else None
        ),
        "nees_mean": _rounded(None if values is None else float(values.mean())),
        "nees_in_bound_pct": _rounded(
            None if values is None else 100.0 * float((values <= NEES_BOUND).mean()), 2
        ),
        "landmarks": len(run.names),
        "wrong_association_pct": _rounded(run.tally.wrong_pct() if identified else None, 2),
        "dead_reckoning_ate_m": _rounded(blind.ate_rmse_m if blind else None),
        "calibration": [round(v, 4) for v in run.calibration.tolist()],
    }


def _error(track: np.ndarray, truth: np.ndarray) -> TrackError | None:
    """Both are at the same times, so that truth with gaps needs no interpolation."""
    if len(truth) < 2:
        return None
    filled = truth.copy()
    filled[:, 3] = np.where(np.isfinite(truth[:, 3]), truth[:, 3], 0.0)
    return compare_tracks(track, filled)


def _landmark_rmse_m(data: SurveyData, run: SurveyRun, true_from_estimate: SE2) -> float | None:
    """RMS distance of the landmarks from what they are, where that is known."""
    pairs = [
        (place, data.landmarks[thing])
        for place, name in zip(run.landmarks, run.names, strict=True)
        if (thing := run.tally.thing(name)) is not None and thing in data.landmarks
    ]
    if not pairs:
        return None
    found, true = (np.array(column) for column in zip(*pairs, strict=True))
    distance = np.hypot(*(true_from_estimate.apply(found) - true).T)
    return float(np.sqrt(np.mean(np.square(distance))))


def _thinned(truth: np.ndarray) -> np.ndarray:
    """Truth at least `TRUTH_EVERY_S` apart."""
    kept: list[int] = []
    for i, t_s in enumerate(truth[:, 0].tolist()):
        if not kept or t_s - truth[kept[-1], 0] >= TRUTH_EVERY_S:
            kept.append(i)
    return truth[kept]


def _rounded(value: float | None, digits: int = 4) -> float | None:
    return None if value is None else round(float(value), digits)
