"""`sweeper bench slam`: recordings of other robots, and our own logs, through the EKF-SLAM.

For each: the error of the track (aligned and from the start), the error of the landmarks, whether
the covariance is honest, wrong associations, and what a step costs beside filterpy's own.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from robot.bench.slam.cost import SIZES, measure_cost
from robot.bench.slam.data import find_surveys
from robot.bench.slam.growth import measure_growth
from robot.bench.slam.own_log import measure_log
from robot.bench.slam.perturb import parse_perturbations, perturb
from robot.bench.slam.picture import draw_map
from robot.bench.slam.survey import measure_survey, run_survey
from robot.config import Config
from robot.errors import DataError
from robot.log.export import write_tum

ASSOCIATIONS = ("known", "unknown")


def bench_slam(
    path: Path,
    association: str | None = None,
    out_dir: Path | None = None,
    perturbations: str = "",
    sizes: tuple[int, ...] = SIZES,
    tell: Callable[[str], None] | None = None,
    growth: bool = False,
    config: Config | None = None,
) -> dict[str, Any]:
    """Measure the recording at `path`, or all under it; `association` None: known and unknown.

    Logs of ours are run with their own configuration, or with `config`.
    With `out_dir`, a picture and TUM trajectories of each go there; `tell` hears how far it is.
    Raises DataError or LogError for what cannot be read.
    """
    changes = parse_perturbations(perturbations)
    logs = [path] if path.suffix == ".mcap" else sorted(path.rglob("*.mcap"))
    if changes and logs:
        raise DataError("--perturb: changes range-bearing recordings, not logs; leave it out.")
    readers = [] if path.suffix == ".mcap" and path.exists() else find_surveys(path)
    if not readers and not logs:
        raise DataError(f"{path}: holds no recording; give MRCLAM, Victoria Park or a log.mcap.")
    runs: list[dict[str, Any]] = []
    for read in readers:
        data = perturb(read(), changes)
        for kind in _associations(association, bool((data.subject >= 0).all())):
            run = run_survey(data, kind == "known")
            row = measure_survey(data, run, kind == "known")
            runs.append(row)
            if tell is not None:
                tell(f"{data.name}, {kind}: {row['ate_rmse_m']} m")
            if out_dir is not None:
                stem = f"{data.name}_{kind}"
                _write(out_dir, stem, run.track, run.truth, run.landmarks, run.landmark_covs)
    for log in logs:
        result = measure_log(log, config, tell)
        runs.append(result.row)
        if out_dir is not None:
            tracks = result.track, result.truth
            _write(out_dir, result.row["name"], *tracks, *result.landmarks)
    grown = measure_growth() if growth else []
    return {"runs": runs, "cost": measure_cost(sizes), "growth": grown}


def _associations(wanted: str | None, named: bool) -> list[str]:
    """What to try; without names in the recording only `unknown` can be."""
    if wanted not in (None, *ASSOCIATIONS):
        raise DataError(f"--association {wanted}: choose known or unknown.")
    if not named:
        return ["unknown"]
    return list(ASSOCIATIONS) if wanted is None else [wanted]


def _write(
    out_dir: Path,
    stem: str,
    track: np.ndarray,
    truth: np.ndarray,
    landmarks: np.ndarray,
    covs: np.ndarray,
) -> None:
    out_dir.mkdir(parents=True, exist_ok=True)
    (out_dir / f"{stem}.tum").write_text(write_tum(track), encoding="utf-8")
    if len(truth):
        true = truth.copy()
        true[:, 3] = np.nan_to_num(true[:, 3])
        (out_dir / f"{stem}_truth.tum").write_text(write_tum(true), encoding="utf-8")
    (out_dir / f"{stem}.png").write_bytes(draw_map(track, truth, landmarks, covs))
