"""The history of a robot that stays switched on: every run becomes a folder of its own.

A run begins when the robot sets out by itself and ends when it rests again: paused is not resting,
and driving by hand begins none. The folder is written by a thread, as `summary.json`, `map.png` and
`trajectory.tum`.
"""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from robot.body.records.observe import NS, Observer
from robot.body.resting import RESTING, begins_run
from robot.evaluate.report import draw_map
from robot.log.export import write_tum
from robot.mapping.rooms import segment_rooms
from robot.messages import Command, Event, MapReport, MissionState

MIN_RUN_S = 10.0  # shorter ones were a mistaken press of a button


class Diary:
    """An `EventLog` in front of the observer; `folder` makes a new folder for a run."""

    def __init__(self, observer: Observer, folder: Callable[[str], Path]) -> None:
        self._observer, self._folder = observer, folder
        self._began: tuple[int, float, str] | None = None
        self._swept_m2 = 0.0
        self._writer: threading.Thread | None = None

    def event(self, event: Event) -> None:
        """Pass on."""
        self._observer.event(event)

    def command(self, command: Command) -> None:
        """Pass on, and note where runs begin and end."""
        self._observer.command(command)
        if not isinstance(command, MissionState):
            return
        if self._began is None and begins_run(command.state):
            begun = datetime.now(UTC).strftime("%Y%m%d-%H%M%S")
            swept_m2 = min(self._swept_m2, command.covered_m2)  # a new run may begin at 0
            self._began = (command.t_ns, swept_m2, begun)
        elif self._began is not None and command.state in RESTING:
            self._end(command, *self._began)
            self._began = None
        self._swept_m2 = command.covered_m2

    def flush(self) -> None:
        """Pass on, and wait for the page that is being written."""
        self._observer.flush()
        if self._writer is not None:
            self._writer.join()

    def _end(self, end: MissionState, start_ns: int, swept_m2: float, begun: str) -> None:
        duration_s = (end.t_ns - start_ns) / NS
        if duration_s < MIN_RUN_S:
            return
        track = self._observer.estimates
        track = track[track[:, 0] >= start_ns / NS]
        page = {
            "began": begun,
            "duration_s": round(duration_s, 1),
            "covered_m2": round(end.covered_m2 - swept_m2, 2),
            "path_m": round(float(np.hypot(*np.diff(track[:, 1:3], axis=0).T).sum()), 2),
            "docked": self._observer.charging,
            "state": end.state,
            "reason": end.reason,
        }
        arguments = (self._folder(begun), page, self._observer.map, track)
        self._writer = threading.Thread(target=write_page, args=arguments, name="diary")
        self._writer.start()


def write_page(
    folder: Path, page: dict[str, Any], report: MapReport | None, track: np.ndarray
) -> None:
    """Write one run; `summary.json` comes last, so that what has one is complete."""
    (folder / "trajectory.tum").write_text(write_tum(track), encoding="utf-8")
    if report is not None:
        picture = draw_map(report, segment_rooms(report.grid), track)
        (folder / "map.png").write_bytes(picture)
    (folder / "summary.json").write_text(json.dumps(page, indent=2) + "\n", encoding="utf-8")
