"""Going home: a route to the place before the dock from which docking begins."""

from __future__ import annotations

from robot.control.wish import halt
from robot.geometry.se2 import SE2
from robot.mission.state import Situation, State, Step, seconds
from robot.mission.states.recover import Recover
from robot.mission.states.rest import give_up
from robot.mission.way import Way

NEAR_M = 0.12  # close enough to the staging place
TIMEOUT_S = 300.0
STAGES_M = (0.0, 0.2, -0.15, 0.4)  # other distances, tried when there is no way to one
LAST_LEG_M = 0.5  # blocked so near the end: it is the place itself that is taken


class Return(State):
    """Drives to `staging_m` before the docked pose."""

    name = "return"
    leaves_trail = True

    def __init__(self) -> None:
        self._way = Way()
        self._since_ns: int | None = None
        self._stage = 0
        self._no_way_ns: int | None = None  # since when no route was driven

    def enter(self, now: Situation) -> None:
        if self._since_ns is None:
            self._since_ns = now.t_ns
            self._stage = now.run.dock_tries  # a new try comes from another place
        self._way.order(now, self._goal(now))

    def tick(self, now: Situation) -> Step:
        way = self._way
        if now.sight.world_from_docked is None:
            return give_up("the dock has not been seen yet, carry the robot there")
        if seconds(self._since_ns or 0, now.t_ns) > TIMEOUT_S:
            return give_up(f"no way back to the dock was found in {TIMEOUT_S:.0f} s")
        step = way.tick(now)
        if way.no_way:
            return self._another_stage(now, way.no_way)
        if way.remaining_m > 0.0:
            self._no_way_ns = None
        if way.done or self._goal(now).distance_m(now.pose) < NEAR_M:
            return Step(then="dock", reason="before the dock, looking for its marker")
        if way.blocked and way.remaining_m < LAST_LEG_M:
            return self._another_stage(now, way.blocked)
        return way.again(now, self) if way.blocked else step

    def _goal(self, now: Situation) -> SE2:
        ahead_m = now.config.staging_m + STAGES_M[self._stage % len(STAGES_M)]
        return (now.sight.world_from_docked or SE2()) @ SE2(-ahead_m)

    def _another_stage(self, now: Situation, why: str) -> Step:
        """Try the next distance; after a round of them, get free first. Not for ever."""
        self._stage += 1
        if self._no_way_ns is None:
            self._no_way_ns = now.t_ns
        elif seconds(self._no_way_ns, now.t_ns) > now.config.no_way_s:
            return give_up(f"no way leads to the dock ({why}); open one, or carry the robot")
        if self._stage % len(STAGES_M) == 0:
            return Step(then=Recover("enclosed", self), reason=f"no way to the dock: {why}")
        self._way.order(now, self._goal(now))
        return Step(halt(f"no way to the dock yet: {why}"))
