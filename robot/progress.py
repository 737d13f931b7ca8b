"""What the command line shows: a live bar while the robot works, tables afterwards."""

from __future__ import annotations

import sys
from types import TracebackType
from typing import Any

from robot.body.records.observe import Snapshot

PIPED_WIDTH = 160  # columns where no terminal says how many it has
LONGEST_NAME = 24


class Progress:
    """A progress bar of covered floor with the mission's phase and the pose error."""

    def __init__(self, *, enabled: bool) -> None:
        self._bar = None
        if enabled:
            from rich.console import Console
            from rich.progress import BarColumn, TextColumn
            from rich.progress import Progress as RichProgress

            self._bar = RichProgress(
                TextColumn("{task.fields[time]:>7}"),
                TextColumn("[bold]{task.description:<10}"),
                BarColumn(),
                TextColumn("{task.percentage:>5.1f} % covered"),
                TextColumn("{task.fields[error]}"),
                console=Console(stderr=True),
            )
            self._task = self._bar.add_task("", total=100.0, time="", error="")

    def update(self, snapshot: Snapshot) -> None:
        """Show the newest state of the run."""
        if self._bar is None:
            return
        error = snapshot.pose_error_m
        self._bar.update(
            self._task,
            description=snapshot.state,
            completed=snapshot.covered_pct or 0.0,
            time=f"{snapshot.t_s:.0f} s",
            error="" if error is None else f"pose error {100 * error:.1f} cm",
        )

    def __enter__(self) -> Progress:
        if self._bar is not None:
            self._bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._bar is not None:
            self._bar.stop()


def print_summary(summary: dict[str, Any]) -> None:
    """The end of a run, as one table."""
    rows = []
    for key, value in summary.items():
        if key == "stage_ms":
            value = ", ".join(f"{stage} {q['p50']:.1f}" for stage, q in value.items())
            key = "stage_ms (median)"
        rows.append({"figure": key, "value": _cell(value)})
    print_table("run", rows)


def print_table(title: str, rows: list[dict[str, Any]]) -> None:
    """Print dictionaries with equal keys as a table; what has no terminal gets it in full width."""
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table

    cells = [[_cell(value) for value in row.values()] for row in rows]
    table = Table(title=title, box=SIMPLE_HEAD, title_justify="left", padding=(0, 1, 0, 0))
    for number, key in enumerate(rows[0] if rows else ()):
        widest = max(len(row[number]) for row in cells)
        table.add_column(key, min_width=min(widest, LONGEST_NAME) if number == 0 else None)
    for row in cells:
        table.add_row(*row)
    Console(width=None if sys.stdout.isatty() else PIPED_WIDTH).print(table)


def _cell(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, dict):
        return ", ".join(
            f"{k} {_cell(v['p50'] if isinstance(v, dict) else v)}" for k, v in value.items()
        )
    return f"{value:.4g}" if isinstance(value, float) else str(value)
