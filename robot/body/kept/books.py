"""The robot's books, kept beside its map: the schedule, hours of its parts, and its last runs.

An `EventLog` that passes everything on and notes what it sees. Files are small, written in a thread
of their own, each under another name first, so that a power cut leaves the old or the new one.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from datetime import datetime
from pathlib import Path
from typing import Any

from robot.body.base import EventLog
from robot.body.kept.schedule import Schedule, due
from robot.body.kept.store import write_whole
from robot.body.resting import RESTING, begins_run
from robot.body.talk.control import ControlSocket
from robot.errors import ConfigError, RequestError
from robot.messages import Answer, Command, DriveCommand, Event, MissionState, Request

NS = 1_000_000_000
LOOK_NS = 5 * NS  # between two looks at the clock
SAVE_S = 300.0  # of use between two savings
MAX_STEP_NS = NS
MIN_RUN_S = 10.0  # shorter ones were a mistaken press of a button
KEEP_RUNS = 200
Verbs = Mapping[str, Callable[[tuple[str, ...]], dict[str, Any]]]
NOTHING: Verbs = {}
LIFE_H = {"brush": 150.0, "filter": 120.0, "sensors": 30.0}  # until care is advised


def local_now() -> datetime:
    """The wall clock, which knows its time zone."""
    return datetime.now().astimezone()


class Books:
    """Reads its files when it begins. Raises ConfigError for a damaged one."""

    def __init__(
        self, log: EventLog, folder: Path, clock: Callable[[], datetime] = local_now
    ) -> None:
        self._log, self._folder, self._clock = log, folder, clock
        self._writer = ThreadPoolExecutor(1, "books")
        self._schedule = Schedule.from_dict(_read(folder / "schedule.json", {"entries": []}))
        hours = _read(folder / "consumables.json", {})
        self._hours = {part: _hours(hours, part, folder) for part in LIFE_H}
        self._runs: list[dict[str, Any]] = _read(folder / "history.json", {"runs": []})["runs"]
        self._looked_ns: int | None = None
        self._driven_ns: int | None = None
        self._used_s = 0.0
        self._state = MissionState(0, "none", "", 0.0, 0.0)
        self._began: tuple[int, str, str] | None = None

    # ------------------------------------------------------------------ EventLog

    def event(self, event: Event) -> None:
        """Hand on."""
        self._log.event(event)

    def command(self, command: Command) -> None:
        """Hand on, and note use and runs."""
        self._log.command(command)
        if isinstance(command, DriveCommand):
            self._use(command)
        elif isinstance(command, MissionState):
            self._run(command)

    def flush(self) -> None:
        """Hand on."""
        self._log.flush()

    def close(self) -> None:
        """Write what is not written yet."""
        self._save("consumables.json", self._hours)
        self._writer.shutdown(wait=True)

    def resting(self) -> bool:
        """Whether the robot has nothing to do."""
        return self._state.state in RESTING

    # ------------------------------------------------------------------ the clock

    def poll(self, now_ns: int) -> list[Request]:
        """Requests that the schedule makes now."""
        if self._looked_ns is not None and now_ns - self._looked_ns < LOOK_NS:
            return []
        self._looked_ns = now_ns
        if not self._schedule.entries:
            return []
        came = due(self._schedule, self._clock())
        self._schedule = came.schedule
        if came.entries:
            self._save("schedule.json", self._schedule.to_dict())
        return [Request(now_ns, entry.words[0], entry.words[1:]) for entry in came.entries]

    # ------------------------------------------------------------------ what is noted

    def _use(self, order: DriveCommand) -> None:
        last, self._driven_ns = self._driven_ns, order.t_ns
        if last is None or self._state.state in RESTING:
            return
        hours = min(order.t_ns - last, MAX_STEP_NS) / NS / 3600.0
        self._hours["sensors"] += hours
        self._hours["brush"] += hours if order.brush > 0.0 else 0.0
        self._hours["filter"] += hours if order.fan > 0.0 else 0.0
        self._used_s += hours * 3600.0
        if self._used_s >= SAVE_S:
            self._used_s = 0.0
            self._save("consumables.json", self._hours)

    def _run(self, state: MissionState) -> None:
        before, self._state = self._state, state
        if self._began is None and begins_run(state.state):
            began = self._clock().isoformat(timespec="seconds")
            self._began = (state.t_ns, began, state.reason)
        elif self._began is not None and state.state in RESTING:
            (start_ns, began, asked), self._began = self._began, None
            duration_s = (state.t_ns - start_ns) / NS
            if duration_s >= MIN_RUN_S:
                self._end(before, state, began, asked, duration_s)

    def _end(
        self, before: MissionState, end: MissionState, began: str, asked: str, duration_s: float
    ) -> None:
        run = {
            "began": began,
            "asked": asked,
            "duration_s": round(duration_s, 1),
            "covered_m2": round(before.covered_m2, 2),
            "state": end.state,
            "reason": end.reason,
        }
        self._runs = [*self._runs, run][-KEEP_RUNS:]
        name = began.replace(":", "").replace("+", "p")
        self._save(f"runs/{name}.json", run)
        self._save("history.json", {"runs": self._runs})
        self._save("consumables.json", self._hours)

    # ------------------------------------------------------------------ verbs

    def verbs(self) -> Verbs:
        """What `sweeper ask` may look up and change here; each may raise RequestError."""
        return {
            "schedule list": self._list,
            "schedule add": self._add,
            "schedule remove": self._remove,
            "consumables": self._parts,
            "consumables reset": self._reset,
            "history": self._history,
        }

    def _list(self, args: tuple[str, ...]) -> dict[str, Any]:
        lines = [f"{i}: {entry}" for i, entry in enumerate(self._schedule.entries, 1)]
        data = {"lines": lines, **self._schedule.to_dict()}
        return {"reason": f"{len(lines)} entries" if lines else "no entries", "data": data}

    def _add(self, args: tuple[str, ...]) -> dict[str, Any]:
        schedule = self._schedule.add(args[0], args[1], args[2:])
        if not self._schedule.entries:  # the clock has not been looked at until now
            schedule = due(schedule, self._clock()).schedule
        return self._set_schedule(schedule, f"added: {schedule.entries[-1]}")

    def _remove(self, args: tuple[str, ...]) -> dict[str, Any]:
        return self._set_schedule(self._schedule.remove(round(float(args[0]))), "removed")

    def _set_schedule(self, schedule: Schedule, reason: str) -> dict[str, Any]:
        self._schedule = schedule
        self._save("schedule.json", schedule.to_dict())
        return {"reason": reason}

    def _parts(self, args: tuple[str, ...]) -> dict[str, Any]:
        lines = [
            f"{part}: {hours:.1f} h of {LIFE_H[part]:.0f} h" for part, hours in self._hours.items()
        ]
        worn = [part for part, hours in self._hours.items() if hours >= LIFE_H[part]]
        reason = f"see to: {', '.join(worn)}" if worn else "all parts are good"
        hours = {part: round(hours, 2) for part, hours in self._hours.items()}
        return {"reason": reason, "data": {"lines": lines, "hours": hours, "life_h": LIFE_H}}

    def _reset(self, args: tuple[str, ...]) -> dict[str, Any]:
        part = args[0].lower()
        if part not in self._hours:
            raise RequestError(f"part {args[0][:20]!r}: choose one of {', '.join(LIFE_H)}.")
        self._hours[part] = 0.0
        self._save("consumables.json", self._hours)
        return {"reason": f"{part} counts from 0 again"}

    def _history(self, args: tuple[str, ...]) -> dict[str, Any]:
        count = max(1, min(KEEP_RUNS, round(float(args[0])))) if args else 10
        runs = self._runs[-count:][::-1]
        lines = [
            f"{run['began']}: {run['duration_s'] / 60.0:.0f} min, {run['covered_m2']} m2, "
            f"{run['state']} ({run['reason']})"
            for run in runs
        ]
        reason = f"{len(self._runs)} runs are known" if runs else "no run is known yet"
        return {"reason": reason, "data": {"lines": lines, "runs": runs}}

    def _save(self, name: str, content: Any) -> None:
        text = json.dumps(content, indent=1)  # now: it may change before the thread comes to it
        self._writer.submit(_write, self._folder / name, text)


class WithSchedule:
    """People over the socket, if there is one, and the schedule. Implements `Asked`."""

    def __init__(self, people: ControlSocket | None, books: Books, more: Verbs = NOTHING) -> None:
        """`more` are verbs that somebody beside the books answers at once."""
        self._people, self._books = people, books
        if people is not None:
            people.books = {**books.verbs(), **more}

    def poll(self, now_ns: int) -> list[Request]:
        """See `Asked`."""
        asked = [] if self._people is None else self._people.poll(now_ns)
        return asked + self._books.poll(now_ns)

    def answer(self, answer: Answer) -> None:
        """See `Asked`; the schedule does not listen."""
        if self._people is not None:
            self._people.answer(answer)

    def close(self) -> None:
        """See `Asked`."""
        if self._people is not None:
            self._people.close()


def _read(path: Path, default: dict[str, Any]) -> dict[str, Any]:
    """A JSON object with the default's keys. Raises ConfigError for a file that holds none."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return default
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path}: cannot be read ({error}); correct or remove it.") from None
    if not isinstance(content, dict) or not default.keys() <= content.keys():
        raise ConfigError(f"{path}: {', '.join(default)} is missing there; correct or remove it.")
    return content


def _hours(content: dict[str, Any], part: str, folder: Path) -> float:
    hours = content.get(part, 0.0)
    if isinstance(hours, int | float) and not isinstance(hours, bool) and 0.0 <= hours < 1e6:
        return float(hours)
    raise ConfigError(f"{folder / 'consumables.json'}: {part} must be hours; correct it.")


def _write(path: Path, text: str) -> None:
    """The whole new file, or the old one stays. A full card must not stop the robot."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, f"{text}\n".encode())
    except OSError:
        return
