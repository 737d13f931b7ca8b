"""What the command line shows: a live bar while the robot works, tables afterwards."""

from __future__ import annotations

from types import TracebackType
from typing import Any

from robot.body.observe import Snapshot


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
    """Print dictionaries with equal keys as a table."""
    from rich.console import Console
    from rich.table import Table

    table = Table(title=title)
    for key in rows[0] if rows else ():
        table.add_column(key)
    for row in rows:
        table.add_row(*(_cell(value) for value in row.values()))
    Console().print(table)


def _cell(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, dict):
        return ", ".join(
            f"{k} {_cell(v['p50'] if isinstance(v, dict) else v)}" for k, v in value.items()
        )
    return f"{value:.4g}" if isinstance(value, float) else str(value)
