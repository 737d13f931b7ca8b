"""What a run leaves behind besides its log: tracks, covered floor, stage times, last map.

The observer stands between the loop and the log, and beside the body's recorder. It only reads.
A robot that stays switched on for months is docked for most of them: at rest one pose a minute is
kept of a track, and of all that is measured the newest.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from robot.body.base import EventLog, Recorder
from robot.body.records.newest import Newest
from robot.body.resting import RESTING
from robot.geometry.se2 import SE2
from robot.messages import (
    Command,
    Contact,
    Event,
    MapReport,
    MissionState,
    PoseEstimate,
    Seen,
    StereoFrame,
    Tick,
)

NS = 1_000_000_000
SNAPSHOT_NS = 2 * NS
RESTING_NS = 60 * NS  # between two poses of a track while the robot rests
POSES = 200_000  # of a track: more than five hours of driving
TIMES = 50_000  # of a stage


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The state of a run, for a progress bar."""

    t_s: float
    state: str
    covered_pct: float | None
    pose_error_m: float | None


class Observer:
    """Implements `EventLog` and `Recorder`: passes everything on and keeps the figures.

    `covered_pct` is asked with an array (n, 4) of true (t_s, x_m, y_m, yaw_rad) so far.
    """

    def __init__(
        self,
        log: EventLog,
        recorder: Recorder,
        on_snapshot: Callable[[Snapshot], None],
        covered_pct: Callable[[np.ndarray], float] | None = None,
    ) -> None:
        self._log, self._recorder = log, recorder
        self._on_snapshot, self._covered_pct = on_snapshot, covered_pct
        self.on_truth: Callable[[SE2], None] = lambda world_from_base: None
        self._next_snapshot_ns = 0
        self._estimates, self._truth = Newest(4, POSES), Newest(4, POSES)
        self._estimated_ns = self._true_ns = -RESTING_NS
        self._stage_ms: dict[str, Newest] = {}
        self.mission = MissionState(0, "none", "nothing has happened yet", 0.0, 0.0)
        self.map: MapReport | None = None
        self.t_ns = 0
        self.charging = False

    @property
    def estimates(self) -> np.ndarray:
        """Estimated track (n, 4): t_s, x_m, y_m, yaw_rad in `world`."""
        return self._estimates.rows

    @property
    def true_track(self) -> np.ndarray:
        """True track (n, 4), empty without truth."""
        return self._truth.rows

    @property
    def stage_ms(self) -> dict[str, np.ndarray]:
        """Milliseconds (n,) of each stage of perception."""
        return {stage: times.rows[:, 0] for stage, times in self._stage_ms.items()}

    def event(self, event: Event) -> None:
        """Log one event."""
        self._log.event(event)
        self.t_ns = event.t_ns
        if isinstance(event, Seen):
            for stage, ms in event.stage_ms.items():
                self._stage_ms.setdefault(stage, Newest(1, TIMES)).append(ms)
        elif isinstance(event, Contact):
            self.charging = event.charging
        elif isinstance(event, Tick) and event.t_ns >= self._next_snapshot_ns:
            self._next_snapshot_ns = event.t_ns + SNAPSHOT_NS
            self._on_snapshot(self._snapshot())

    def command(self, command: Command) -> None:
        """Log one command or report."""
        self._log.command(command)
        if isinstance(command, PoseEstimate):
            if self._due(command.t_ns, self._estimated_ns):
                self._estimated_ns = command.t_ns
                self._estimates.append(*_row(command.t_ns, command.world_from_base))
        elif isinstance(command, MissionState):
            self.mission = command
        elif isinstance(command, MapReport):
            self.map = command

    def flush(self) -> None:
        """Flush the log."""
        self._log.flush()

    def frame(self, frame: StereoFrame) -> None:
        """Record one pair of images."""
        self._recorder.frame(frame)

    def truth(self, t_ns: int, world_from_base: SE2) -> None:
        """Keep and record where the robot truly is."""
        if self._due(t_ns, self._true_ns):
            self._true_ns = t_ns
            self._truth.append(*_row(t_ns, world_from_base))
        self.on_truth(world_from_base)
        self._recorder.truth(t_ns, world_from_base)

    def _due(self, t_ns: int, kept_ns: int) -> bool:
        """Whether a pose belongs into its track; at rest the same ones of both tracks."""
        return self.mission.state not in RESTING or t_ns // RESTING_NS != kept_ns // RESTING_NS

    def _snapshot(self) -> Snapshot:
        error = None
        if len(self._truth) and len(self._estimates):
            last = self.estimates[-1]
            at = self.true_track[-20:]
            at = at[at[:, 0] == last[0]]
            if len(at):
                error = float(np.hypot(*(at[0] - last)[1:3]))
        done, left = self.mission.covered_m2, self.mission.remaining_m2
        covered = 100.0 * done / (done + left) if done + left > 0 else None
        if self._covered_pct is not None and len(self._truth):
            covered = self._covered_pct(self.true_track)
        return Snapshot(self.t_ns / NS, self.mission.state, covered, error)


def _row(t_ns: int, pose: SE2) -> tuple[float, float, float, float]:
    return t_ns / NS, pose.x_m, pose.y_m, pose.yaw_rad
