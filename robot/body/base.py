"""The two protocols of the loop: a body, and the log it is written to."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

from robot.geometry.se2 import SE2
from robot.messages import Answer, Command, Event, Request, StereoFrame


class Body(Protocol):
    """Whatever the brain lives in: hardware, recordings, a replayed log, a simulator."""

    def events(self) -> Iterator[Event]:
        """Everything that happens, in order of arrival, until the life ends."""

    def send(self, command: Command) -> None:
        """Carry out a command; reports are addressed to nobody and may be ignored."""


class EventLog(Protocol):
    """Where the loop writes what happened and what was ordered."""

    def event(self, event: Event) -> None: ...

    def command(self, command: Command) -> None: ...

    def flush(self) -> None: ...


class Asked(Protocol):
    """Whoever asks something of the robot: people over a socket, the schedule."""

    def poll(self, now_ns: int) -> list[Request]:
        """Requests since the last call; never waits."""

    def answer(self, answer: Answer) -> None:
        """What became of one."""

    def close(self) -> None:
        """Nobody asks any more."""


class Recorder(Protocol):
    """Where a body writes what the brain must not see: images and the simulator's truth."""

    def frame(self, frame: StereoFrame) -> None: ...

    def truth(self, t_ns: int, world_from_base: SE2) -> None: ...
