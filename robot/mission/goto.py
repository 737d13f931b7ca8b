"""Driving to a place of the map, and waiting there."""

from __future__ import annotations

from robot.control.wish import halt
from robot.geometry.se2 import SE2
from robot.mission.drive import Drive
from robot.mission.recover import Recover
from robot.mission.rest import Idle, give_up
from robot.mission.state import Situation, State, Step, seconds

TIMEOUT_S = 300.0
MAX_UNANSWERED = 3
MAX_REFUSALS = 3  # the planner knows no way
GRIDLOCK_M = 0.15
NEAR_M = 0.35  # blocked so near to the place: it is taken, and this is as near as it gets


class GoTo(State):
    """One route after another until the place is reached, or no way leads there."""

    name = "goto"
    leaves_trail = True

    def __init__(self, place: SE2) -> None:
        self._place = place
        self._since_ns: int | None = None
        self._drive: Drive | None = None
        self._unanswered = self._refused = 0
        self._blocked_at_m: float | None = None

    def enter(self, now: Situation) -> None:
        if self._since_ns is None:
            self._since_ns = now.t_ns
        self._order(now)

    def tick(self, now: Situation) -> Step:
        where = f"{self._place.x_m:.2f} {self._place.y_m:.2f}"
        if seconds(self._since_ns or 0, now.t_ns) > TIMEOUT_S:
            return give_up(f"the place {where} was not reached in {TIMEOUT_S:.0f} s")
        answer = now.desk.take()
        if answer is not None and len(answer.path.points_m) == 0:
            self._refused += 1
            if self._refused >= MAX_REFUSALS:
                return Step(then=Idle(), reason=f"no way leads to {where}: {answer.reason}")
            return Step(then=Recover("enclosed", self), reason=f"no way yet: {answer.reason}")
        if answer is not None:
            self._drive, self._unanswered = Drive(answer.path, now, cleans=False), 0
        elif now.desk.waited_s(now.t_ns) > now.config.plan_timeout_s:
            self._unanswered += 1
            if self._unanswered >= MAX_UNANSWERED:
                return give_up("the planner does not answer")
            self._order(now)
        if self._drive is None:
            return Step(halt("waiting for a route"))
        wish = self._drive.tick(now)
        if self._drive.done:
            return Step(then=Idle(), reason=f"arrived at {where}")
        if self._drive.blocked:
            return self._blocked(now, self._drive.blocked, where)
        return Step(wish)

    def _order(self, now: Situation) -> None:
        self._drive = None
        now.desk.order(now.t_ns, "route", now.pose, now.orders, self._place)

    def _blocked(self, now: Situation, why: str, where: str) -> Step:
        if self._place.distance_m(now.pose) < NEAR_M:
            return Step(then=Idle(), reason=f"as near to {where} as it gets: {why}")
        at_m, self._blocked_at_m = self._blocked_at_m, now.driven_m
        if at_m is not None and now.driven_m - at_m < GRIDLOCK_M:
            return Step(then=Recover("blocked", self), reason=why)
        self._order(now)
        return Step(halt(why))
