"""What people may watch of a running robot: it listens beside the log, and a thread tells the rest.

The loop only leaves references behind; cutting, packing and sending happen in the publisher's
thread, and a reader that does not keep up is dropped.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from robot import __version__
from robot.body.base import EventLog
from robot.body.resting import RESTING
from robot.body.talk.stream import PROTOCOL
from robot.messages import (
    Battery,
    Command,
    Contact,
    DriveCommand,
    Event,
    Grid,
    LinkState,
    MapReport,
    MissionState,
    PoseEstimate,
    Seen,
    Tick,
)
from robot.mission.verbs import VERBS

NS = 1_000_000_000
VIEW_NS = 400_000_000  # 2.5 Hz, as often as the brain looks at its own map
STATUS_NS = NS
POSE_NS = 90_000_000  # every estimate at 10 Hz
CRUMB_M = 0.03
MAX_CRUMBS = 40_000


class Sight(Protocol):
    """What the brain shows of its map (`Brain.view`)."""

    def view(self) -> tuple[Grid, np.ndarray]: ...


@dataclass
class Track:
    """Where the robot drove since the last start: crumbs, and how often it began anew."""

    points: list[tuple[float, float]] = field(default_factory=list)
    number: int = 0

    def add(self, x_m: float, y_m: float) -> None:
        """Drop a crumb where the last one is far enough; thin out what grows too long."""
        if self.points and math.hypot(x_m - self.points[-1][0], y_m - self.points[-1][1]) < CRUMB_M:
            return
        if len(self.points) >= MAX_CRUMBS:
            self.points = self.points[::2]
            self.number += 1
        self.points.append((round(x_m, 3), round(y_m, 3)))

    def restart(self) -> None:
        """A new run begins."""
        self.points, self.number = [], self.number + 1


class Outlook:
    """An `EventLog` that passes everything on and keeps the newest of what people watch.

    `wanted` says whether anyone is watching: the map is looked at only then.
    """

    def __init__(self, log: EventLog, brain: Sight, body: str, radius_m: float) -> None:
        self._log, self._brain = log, brain
        self.hello: dict[str, Any] = {
            "type": "hello",
            "protocol": PROTOCOL,
            "software": __version__,
            "body": body,
            "radius_m": radius_m,
        }
        self.offer("mission", "map", "books")
        self.wanted = False
        self.wake: Callable[[], None] = lambda: None
        self._lock = threading.Lock()
        self._status_ns = self._pose_ns = self._view_ns = -NS
        self._started_ns: int | None = None
        self._told = ("", "")
        self._mission = MissionState(0, "none", "nothing has happened yet", 0.0, math.nan)
        self._contact, self._link = Contact(0), LinkState(0, False)
        self._battery = Battery(0, math.nan, math.nan)
        self._drive = (0.0, 0.0)
        self._stage_ms: dict[str, float] = {}
        self._health = "ok"
        self.track = Track()
        self._news: dict[str, Any] = {}

    def offer(self, *places: str) -> None:
        """Tell watchers to come of the verbs that these answer (`Verb.place`)."""
        verbs = [verb for verb in VERBS if verb.place in places]
        self.hello["verbs"] = [verb.name for verb in verbs]
        self.hello["commands"] = [verb.as_dict() for verb in verbs]

    # ------------------------------------------------------------------ EventLog

    def event(self, event: Event) -> None:
        """Log one event, and note what it changes."""
        self._log.event(event)
        if isinstance(event, Tick):
            self._tick(event.t_ns)
        elif isinstance(event, Seen):
            self._smooth(event.stage_ms)
        elif isinstance(event, Battery):
            self._battery = event
        elif isinstance(event, Contact):
            if event.charging != self._contact.charging:
                self._status_ns = -NS
            self._contact = event
        elif isinstance(event, LinkState):
            self._link = event

    def command(self, command: Command) -> None:
        """Log one command, and note what it reports."""
        self._log.command(command)
        if isinstance(command, DriveCommand):
            self._drive = (command.v_mps, command.yaw_rate_radps)
        elif isinstance(command, PoseEstimate):
            self._estimate(command)
        elif isinstance(command, MissionState):
            self._state(command)
        elif isinstance(command, MapReport):
            self._tell("landmarks", command)

    def flush(self) -> None:
        """Flush the log."""
        self._log.flush()

    def news(self) -> dict[str, Any]:
        """What has changed since the last call: newest of each kind. For the publisher's thread."""
        with self._lock:
            news, self._news = self._news, {}
        return news

    def crumbs(self, number: int, start: int) -> tuple[int, int, list[tuple[float, float]]]:
        """(track number, first index, points) that a reader of `start` points of `number` lacks."""
        track = self.track
        first = start if number == track.number else 0
        return track.number, first, track.points[first:]

    # ------------------------------------------------------------------ parts

    def _tick(self, t_ns: int) -> None:
        if t_ns - self._status_ns >= STATUS_NS:
            self._status_ns = t_ns
            self._tell("status", self._status(t_ns))
        if self.wanted and t_ns - self._view_ns >= VIEW_NS:
            self._view_ns = t_ns
            self._tell("view", self._brain.view())

    def _state(self, state: MissionState) -> None:
        resting = state.state in RESTING
        if not resting and self._mission.state in RESTING:
            self._started_ns = state.t_ns
            self.track.restart()
        self._mission = state
        if (state.state, state.reason) != self._told:
            self._told = (state.state, state.reason)
            self._status_ns = state.t_ns
            self._tell("status", self._status(state.t_ns))
            self.wake()

    def _estimate(self, estimate: PoseEstimate) -> None:
        self._health = estimate.health
        pose, cov = estimate.world_from_base, estimate.cov
        if self._mission.state not in RESTING:
            self.track.add(pose.x_m, pose.y_m)
        if self.wanted and estimate.t_ns - self._pose_ns >= POSE_NS:
            self._pose_ns = estimate.t_ns
            values = [cov[0, 0], cov[0, 1], cov[1, 1], cov[2, 2]]
            if not np.isfinite([pose.x_m, pose.y_m, pose.yaw_rad, *values]).all():
                return
            self._tell(
                "pose",
                {
                    "type": "pose",
                    "t_s": estimate.t_ns / NS,
                    "x_m": round(pose.x_m, 4),
                    "y_m": round(pose.y_m, 4),
                    "yaw_rad": round(pose.yaw_rad, 4),
                    "cov": [float(f"{value:.3g}") for value in values],  # xx, xy, yy, yaw
                    "health": estimate.health,
                    "v_mps": round(self._drive[0], 3),
                    "yaw_rate_radps": round(self._drive[1], 3),
                },
            )

    def _status(self, t_ns: int) -> dict[str, Any]:
        mission, started = self._mission, self._started_ns
        return {
            "type": "status",
            "t_s": round(t_ns / NS, 2),
            "state": mission.state,
            "reason": mission.reason,
            "health": self._health,
            "run_s": None if started is None else round((t_ns - started) / NS, 1),
            "covered_m2": _known(mission.covered_m2),
            "remaining_m2": _known(mission.remaining_m2),
            "battery_pct": _known(self._battery.charge_pct),
            "battery_v": _known(self._battery.voltage_v),
            "charging": self._contact.charging,
            "bumped": self._contact.bump_left or self._contact.bump_right,
            "cliff": self._contact.cliff,
            "wheel_drop": self._contact.wheel_drop,
            "link": self._link.connected,
            "stop_reason": self._link.stop_reason,
            "stage_ms": {stage: round(ms, 2) for stage, ms in self._stage_ms.items()},
        }

    def _smooth(self, stage_ms: dict[str, float]) -> None:
        """An exponential mean over about a second of frames."""
        for stage, ms in stage_ms.items():
            old = self._stage_ms.get(stage, ms)
            self._stage_ms[stage] = old + 0.1 * (ms - old)

    def _tell(self, kind: str, value: Any) -> None:
        with self._lock:
            self._news[kind] = value


def _known(value: float) -> float | None:
    return round(value, 2) if math.isfinite(value) else None
