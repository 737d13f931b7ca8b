"""The states in which the robot stands still and waits for a person."""

from __future__ import annotations

from robot.control.wish import halt
from robot.messages import StopOrder
from robot.mission.state import Latch, Name, Situation, State, Step, seconds

CLEAR_TIMEOUT_S = 4.0


class Idle(State):
    """Waiting for a request; called "docked" while the charge contact is closed."""

    active = guarded = False

    def __init__(self) -> None:
        self.name = "idle"

    def enter(self, now: Situation) -> None:
        self.name = "docked" if now.contact.charging else "idle"

    def tick(self, now: Situation) -> Step:
        self.enter(now)
        return Step(halt("waiting for a request"))


class Starting(State):
    """Clears a stop that is still held, then goes on."""

    name = "starting"
    guarded = False

    def __init__(self, then: State | Name, reason: str) -> None:
        self._then = then
        self._reason = reason

    def enter(self, now: Situation) -> None:
        self._latch = Latch()
        self._since_ns = now.t_ns

    def tick(self, now: Situation) -> Step:
        if self._latch.clear(now, self._reason):
            return Step(then=self._then, reason=self._reason)
        if seconds(self._since_ns, now.t_ns) > CLEAR_TIMEOUT_S:
            return give_up(f"the motor controller keeps its stop: {now.link.stop_reason}")
        return Step(halt("waiting for the motor controller"))


class Paused(State):
    """Standing until a person says resume; the state before is kept."""

    name = "paused"
    active = guarded = False

    def __init__(self, before: State) -> None:
        self.before = before

    def tick(self, now: Situation) -> Step:
        return Step(halt("paused"))


class Done(State):
    """The run has ended well: the robot is docked."""

    name = "done"
    active = guarded = False

    def tick(self, now: Situation) -> Step:
        return Step(halt("the run is over"))


class Error(State):
    """The robot has given up; the reason of the change says why. The stop is latched."""

    name = "error"
    active = guarded = False

    def __init__(self, reason: str) -> None:
        self._reason = reason

    def enter(self, now: Situation) -> None:
        now.desk.drop()
        now.orders.append(StopOrder(now.t_ns, self._reason))

    def tick(self, now: Situation) -> Step:
        return Step(halt(self._reason))


def give_up(reason: str) -> Step:
    """The step into `Error`."""
    return Step(then=Error(reason), reason=reason)
