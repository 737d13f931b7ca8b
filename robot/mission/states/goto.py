"""Driving to a place of the map, and waiting there."""

from __future__ import annotations

from robot.geometry.se2 import SE2
from robot.mission.state import Situation, State, Step, seconds
from robot.mission.states.recover import Recover
from robot.mission.states.rest import Idle, give_up
from robot.mission.way import Way

TIMEOUT_S = 300.0
MAX_REFUSALS = 3  # the planner knows no way
NEAR_M = 0.35  # blocked so near to the place: it is taken, and this is as near as it gets


class GoTo(State):
    """Ends at the place, or where no way leads there."""

    name = "goto"
    leaves_trail = True

    def __init__(self, place: SE2) -> None:
        self._place = place
        self._way = Way()
        self._since_ns: int | None = None
        self._refused = 0

    def enter(self, now: Situation) -> None:
        if self._since_ns is None:
            self._since_ns = now.t_ns
        self._way.order(now, self._place)

    def tick(self, now: Situation) -> Step:
        way, where = self._way, f"{self._place.x_m:.2f} {self._place.y_m:.2f}"
        if seconds(self._since_ns or 0, now.t_ns) > TIMEOUT_S:
            return give_up(f"the place {where} was not reached in {TIMEOUT_S:.0f} s")
        step = way.tick(now)
        if way.no_way:
            self._refused += 1
            if self._refused >= MAX_REFUSALS:
                return Step(then=Idle(), reason=f"no way leads to {where}: {way.no_way}")
            return Step(then=Recover("enclosed", self), reason=f"no way yet: {way.no_way}")
        if way.done:
            return Step(then=Idle(), reason=f"arrived at {where}")
        if way.blocked and self._place.distance_m(now.pose) < NEAR_M:
            return Step(then=Idle(), reason=f"as near to {where} as it gets: {way.blocked}")
        return way.again(now, self) if way.blocked else step
