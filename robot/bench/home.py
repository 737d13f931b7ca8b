"""`sweeper bench home`: whole cleaning runs in the simulator, many scenes and seeds side by side.

Every run is a process of its own: the real firmware, bridge, SLAM, planner and mission, with
rendered frames, or with sights drawn from perception's measured errors (`drawn`).
"""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Iterable, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from statistics import mean
from typing import Any

from robot.body.cleaning import RunOptions, run_cleaning
from robot.body.records.observe import Snapshot
from robot.config import Config
from robot.errors import MissingExtraError, SweeperError
from robot.evaluate.progress_picture import draw_progress

MEASURED = ("duration_s", "covered_pct", "ate_rmse_m", "path_m", "contacts", "max_contact_mps")
Curve = list[tuple[float, float]]


@dataclass(frozen=True, slots=True)
class HomeOptions:
    """Which runs, and how."""

    scenes: tuple[str, ...]
    seeds: tuple[int, ...]
    drawn: bool = False
    duration_s: float | None = None
    jobs: int = 0  # 0: as many as there are cores
    scheduler: str = ""  # address of a Dask cluster
    out: Path = Path("bench")


def parse_seeds(text: str) -> tuple[int, ...]:
    """Numbers and ranges: "1,3,10-12". Raises SweeperError."""
    seeds: list[int] = []
    try:
        for part in text.split(","):
            first, dash, last = part.partition("-")
            seeds += range(int(first), int(last if dash else first) + 1)
    except ValueError:
        seeds = []
    if not seeds:
        raise SweeperError(f'--seeds {text}: give numbers and ranges, like "1,3,10-12".')
    return tuple(seeds)


def parse_scenes(text: str) -> tuple[str, ...]:
    """Names and files by commas; "all" is every built-in one, "random:3-7" five homes by seed.

    Raises SweeperError.
    """
    from robot.sim.scene import RANDOM, builtin_scenes

    scenes: list[str] = []
    for name in filter(None, (part.strip() for part in text.split(","))):
        if name == "all":
            scenes += builtin_scenes()
        elif name.startswith(RANDOM) and "-" in name:
            scenes += [f"{RANDOM}{seed}" for seed in parse_seeds(name.removeprefix(RANDOM))]
        else:
            scenes.append(name)
    if not scenes:
        raise SweeperError(f'--scenes {text}: give names or files, like "flat,random:1-5", or all.')
    return tuple(scenes)


def bench_home(options: HomeOptions, config: Config) -> dict[str, Any]:
    """All runs, in the order of scenes and seeds: `{"runs": [summary], "mean": {...}}`.

    Run folders and `coverage.png` go to `options.out`. Raises SceneError for an unknown scene.
    """
    wanted = [
        RunOptions(
            scene=scene,
            seed=seed,
            duration_s=options.duration_s,
            drawn=options.drawn,
            out=options.out,
        )
        for scene in options.scenes
        for seed in options.seeds
    ]
    found = _run_all(wanted, options, config)
    runs = [summary for summary, _ in found]
    curves = {f"{s['scene']} {s['seed']}": curve for s, curve in found}
    options.out.mkdir(parents=True, exist_ok=True)
    draw_progress(options.out / "coverage.png", curves)
    return {"runs": runs, "mean": _mean(runs)}


def one_run(options: RunOptions, config: Config) -> tuple[dict[str, Any], Curve]:
    """One summary, and covered floor over time as (t_s, pct)."""
    curve: Curve = []

    def note(now: Snapshot) -> None:
        if now.covered_pct is not None:
            curve.append((now.t_s, now.covered_pct))

    return run_cleaning(options, config, note), curve


def _run_all(
    wanted: Sequence[RunOptions], options: HomeOptions, config: Config
) -> list[tuple[dict[str, Any], Curve]]:
    if options.scheduler:
        return _on_cluster(wanted, options.scheduler, config)
    jobs = min(len(wanted), options.jobs or os.cpu_count() or 1)
    if jobs == 1:
        return [one_run(run, config) for run in wanted]
    # A run makes processes of its own, so its process must not be a daemon: no plain Pool.
    with ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn")) as pool:
        return _gather(pool, wanted, config)


def _gather(
    pool: Executor, wanted: Iterable[RunOptions], config: Config
) -> list[tuple[dict[str, Any], Curve]]:
    """Results in the order of the wishes; the first failure ends all."""
    runs = [pool.submit(one_run, run, config) for run in wanted]
    for done in as_completed(runs):
        if done.exception() is not None:
            pool.shutdown(cancel_futures=True)
    return [run.result() for run in runs]


def _on_cluster(
    wanted: Sequence[RunOptions], address: str, config: Config
) -> list[tuple[dict[str, Any], Curve]]:
    try:
        from distributed import Client
    except ImportError:
        raise MissingExtraError(
            "--scheduler needs Dask: install it with `pip install 'sweeper[bench]'`."
        ) from None
    with Client(address) as client:
        return _gather(client.get_executor(), wanted, config)


def _mean(runs: Sequence[dict[str, Any]]) -> dict[str, Any]:
    figures: dict[str, Any] = {"runs": len(runs)}
    for key in MEASURED:
        known = [run[key] for run in runs if run[key] is not None]
        figures[key] = round(mean(known), 4) if known else None
    figures["covered_pct_min"] = min((run["covered_pct"] for run in runs), default=None)
    figures["docked_pct"] = 100.0 * mean(bool(run["docked"]) for run in runs) if runs else None
    figures["cliffs_entered"] = sum(bool(run["cliff_entered"]) for run in runs)
    return figures
