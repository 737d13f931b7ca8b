"""The way to a place: ask for a route, wait for it, drive it, and ask again where it is blocked."""

from __future__ import annotations

from robot.control.wish import halt
from robot.geometry.se2 import SE2
from robot.mission.drive import Drive
from robot.mission.state import Situation, State, Step
from robot.mission.states.recover import Recover
from robot.mission.states.rest import give_up

MAX_UNANSWERED = 3
GRIDLOCK_M = 0.15  # blocked again before so much was driven: planning alone does not help


class Way:
    """One route after another. After a `tick`, `no_way`, `done` and `blocked` say what became."""

    def __init__(self) -> None:
        self._goal = SE2()
        self._drive: Drive | None = None
        self._unanswered = 0
        self._blocked_at_m: float | None = None
        self.no_way = ""  # why the planner knows none
        self.blocked = ""  # why the route cannot be driven on
        self.done = False

    @property
    def remaining_m(self) -> float:
        """Length of the route still to drive, 0 without one."""
        return 0.0 if self._drive is None else self._drive.remaining_m

    def order(self, now: Situation, goal: SE2) -> None:
        """Ask for a route from here."""
        self._goal, self._drive, self.done = goal, None, False
        now.desk.order(now.t_ns, "route", now.pose, now.orders, goal)

    def tick(self, now: Situation) -> Step:
        """Wait, or drive on; the end if the planner never answers."""
        self.no_way = self.blocked = ""
        answer = now.desk.take()
        if answer is not None:
            self._unanswered = 0
            if len(answer.path.points_m) == 0:
                self.no_way = answer.reason
                return Step(halt(f"no way yet: {answer.reason}"))
            self._drive = Drive(answer.path, now, cleans=False)
        elif now.desk.waited_s(now.t_ns) > now.config.plan_timeout_s:
            self._unanswered += 1
            if self._unanswered >= MAX_UNANSWERED:
                return give_up("the planner does not answer")
            self.order(now, self._goal)
        if self._drive is None:
            return Step(halt("waiting for a route"))
        wish = self._drive.tick(now)
        self.done, self.blocked = self._drive.done, self._drive.blocked
        return Step(wish)

    def again(self, now: Situation, state: State) -> Step:
        """Another route round what blocks this one; blocked on the spot, get free first."""
        why, at_m = self.blocked, self._blocked_at_m
        self._blocked_at_m = now.driven_m
        if at_m is not None and now.driven_m - at_m < GRIDLOCK_M:
            return Step(then=Recover("blocked", state), reason=why)
        self.order(now, self._goal)
        return Step(halt(why))
