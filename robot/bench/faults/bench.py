"""`sweeper bench faults`: twelve things that go wrong, many times each.

A fault is *resolved* when the robot works on without trouble, or has done what the fault demands
(docked, charging), and *announced* when it stands with a reason that names the trouble. Both count
from the moment the robot met the fault.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import Any

from robot.bench.faults.twelve import FAULTS, SCENE, WORK, Fault
from robot.bench.trial import Trial
from robot.config import Config
from robot.errors import SweeperError

LIMIT_S = 60.0
QUIET_S = 12.0  # of work without trouble: it is over
CALM = WORK | {"return", "dock", "charge", "done", "docked"}


def bench_faults(
    trials: int, names: Sequence[str], config: Config, jobs: int = 1
) -> dict[str, Any]:
    """`{"faults": [one row a fault], "trials": [one row a trial]}`. Raises SweeperError."""
    wanted = [fault.name for fault in FAULTS if not names or fault.name in names]
    unknown = set(names) - {fault.name for fault in FAULTS}
    if unknown:
        known = ", ".join(fault.name for fault in FAULTS)
        raise SweeperError(f"--faults {min(unknown)}: unknown; choose of {known}.")
    work = [(name, seed, config) for name in wanted for seed in range(1, trials + 1)]
    if jobs == 1:
        rows = [_job(job) for job in work]
    else:
        with ProcessPoolExecutor(jobs) as pool:
            rows = list(pool.map(_job, work))
    return {"faults": [_sum(name, rows) for name in wanted], "trials": rows}


def run_fault(name: str, seed: int, config: Config) -> dict[str, Any]:
    """One trial, as a row."""
    fault = next(fault for fault in FAULTS if fault.name == name)
    trial = Trial(config, SCENE, seed)
    due_s = float(trial.rng.uniform(*fault.after_s))
    struck: list[float] = []
    troubled: list[float] = []

    def script(trial: Trial, t_s: float) -> None:
        if not struck:
            if t_s >= due_s and fault.ready(trial):
                fault.strike(trial)
                struck.append(t_s)
                trial.end_s = t_s + LIMIT_S + 2.0 * QUIET_S + (60.0 if fault.met else 0.0)
            return
        fault.later(trial, t_s - struck[0])
        if trial.base.faults.patches and not trial.base.faults.entered:
            struck[0], trial.end_s = t_s, t_s + LIMIT_S + 2.0 * QUIET_S  # it has not met it yet
        calm = trial.state in CALM and not fault.met and not fault.ends
        if trial.state not in CALM:
            troubled[:] = [t_s]
        elif calm and troubled and t_s - troubled[0] > 1.5 * QUIET_S:
            trial.end_s = t_s  # it is over

    trial.live(script)
    return _judge(fault, trial, struck[0] if struck else None)


def _judge(fault: Fault, trial: Trial, struck_s: float | None) -> dict[str, Any]:
    row: dict[str, Any] = {
        "fault": fault.name,
        "seed": trial.seed,
        "result": "not met",
        "after_s": None,
        "reason": "",
        "max_contact_mps": max((v for _, v in trial.base.contacts), default=0.0),
    }
    if struck_s is None:
        return row
    after = [s for s in trial.states if s.t_ns * 1e-9 >= struck_s]
    met_s = struck_s
    if fault.met:
        found = [s.t_ns * 1e-9 for s in after if s.state in fault.met]
        if not found:
            return row
        met_s = found[0]
    after = [s for s in after if s.t_ns * 1e-9 >= met_s]
    end = after[-1]
    named = [s for s in after if any(word in s.reason for word in fault.words)]
    row["reason"] = (named or [end])[-1].reason
    troubled = [s.t_ns * 1e-9 for s in after if s.state not in CALM]
    if not troubled and not fault.ends and not fault.met and not trial.base.faults.entered:
        return row
    if end.state in ("error", "idle"):
        first = next(s for s in after if (s.state, s.reason) == (end.state, end.reason))
        row["result"] = "announced" if end in named or end.reason == row["reason"] else "other"
        row["after_s"] = first.t_ns * 1e-9 - met_s
        if not named:
            row["result"] = "other"
    elif end.state in fault.ends:
        row["result"] = "resolved"
        row["after_s"] = next(s.t_ns for s in after if s.state in fault.ends) * 1e-9 - met_s
    elif end.state in CALM and end.t_ns * 1e-9 - max(troubled, default=met_s) >= QUIET_S:
        row["result"] = "resolved"
        row["after_s"] = max(troubled, default=met_s) - met_s
    else:
        row["result"], row["reason"] = "in trouble", f"{end.state}: {end.reason}"
    if row["after_s"] is not None and row["after_s"] > LIMIT_S:
        row["result"] = f"late ({row['result']})"
    return row


def _job(job: tuple[str, int, Config]) -> dict[str, Any]:
    return run_fault(*job)


def _sum(name: str, rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    mine = [row for row in rows if row["fault"] == name]
    good = [row for row in mine if row["result"] in ("resolved", "announced")]
    times = [row["after_s"] for row in good]
    return {
        "fault": name,
        "trials": len(mine),
        "resolved": sum(row["result"] == "resolved" for row in mine),
        "announced": sum(row["result"] == "announced" for row in mine),
        "failed": len(mine) - len(good),
        "slowest_s": round(max(times), 1) if times else None,
        "max_contact_mps": round(max(row["max_contact_mps"] for row in mine), 3),
    }
