"""`sweeper log tidy DIR`: keep the recent runs, remove the older ones."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from robot.errors import LogError

KEEP_RUNS, KEEP_MB = 60, 500


def tidy(folder: Path, keep_runs: int = KEEP_RUNS, keep_mb: float = KEEP_MB) -> dict[str, Any]:
    """Remove the oldest run folders until few enough, and small enough, are left.

    The newest run always stays. Links and files that are no runs are left alone. Raises LogError
    for a folder that is not there.
    """
    if not folder.is_dir():
        raise LogError(f"{folder}: no such folder; name the folder of runs.")
    runs = sorted((p for p in folder.iterdir() if p.is_dir() and not p.is_symlink()), reverse=True)
    kept, removed, total = 0, [], 0
    for run in runs:
        size = sum(p.stat().st_size for p in run.rglob("*") if p.is_file())
        if kept and (kept >= keep_runs or total + size > keep_mb * 1e6):
            shutil.rmtree(run)
            removed.append(run.name)
            continue
        kept, total = kept + 1, total + size
    return {"kept": kept, "removed": removed, "megabytes": round(total / 1e6, 3)}
