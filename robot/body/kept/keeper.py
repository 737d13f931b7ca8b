"""Keeps the home while the robot lives: now and then, when a mission ends, and at the end."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from typing import Protocol

from robot.body.base import EventLog
from robot.body.kept.store import HomeStore
from robot.body.resting import RESTING
from robot.home import Home
from robot.messages import Command, Event, MissionState

EVERY_NS = 300_000_000_000
RESTING_EVERY_NS = 12 * EVERY_NS  # the map stands still then, and the card wears
SETTLED = RESTING | {"charge"}


class Knows(Protocol):
    """The brain, as far as this file looks at it."""

    def home(self) -> Home: ...


class HomeKeeper:
    """A log that also saves. Copies are made in the loop, files written beside it."""

    def __init__(self, log: EventLog, brain: Knows, store: HomeStore) -> None:
        self._log, self._brain, self._store = log, brain, store
        self._writer = ThreadPoolExecutor(1, "home")
        self._writing: Future[None] | None = None
        self._looked_ns: int | None = None
        self._saved_ns = 0
        self._by_people: object = None  # what they had drawn and set when it was saved
        self._state = "none"

    def event(self, event: Event) -> None:
        """Hand on."""
        self._log.event(event)

    def command(self, command: Command) -> None:
        """Hand on; a change to rest, or much time, is worth a copy of the home.

        A robot that goes on resting is asked as often, but only what people changed is kept.
        """
        self._log.command(command)
        if not isinstance(command, MissionState):
            return
        before, self._state = self._state, command.state
        rests = before not in SETTLED and command.state in SETTLED
        if self._looked_ns is None:
            self._looked_ns = self._saved_ns = command.t_ns
            home = self._brain.home()
            self._by_people = (home.notes, home.settings)
        busy = self._writing is not None and not self._writing.done()
        if not busy and (rests or command.t_ns - self._looked_ns >= EVERY_NS):
            self._looked_ns = command.t_ns
            home = self._brain.home()
            by_people = (home.notes, home.settings)
            moves = rests or command.state not in SETTLED
            late = command.t_ns - self._saved_ns >= RESTING_EVERY_NS
            if moves or late or by_people != self._by_people:
                self._saved_ns, self._by_people = command.t_ns, by_people
                self._writing = self._writer.submit(self._store.save, home)

    def flush(self) -> None:
        """Hand on."""
        self._log.flush()

    def close(self) -> None:
        """Save for the last time. Raises MapError where that fails."""
        self._writer.shutdown(wait=True)
        self._store.save(self._brain.home())
