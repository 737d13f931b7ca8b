"""Going home: a route to the place before the dock from which docking begins."""

from __future__ import annotations

from robot.control.wish import halt
from robot.geometry.se2 import SE2
from robot.mission.drive import Drive
from robot.mission.recover import Recover
from robot.mission.rest import give_up
from robot.mission.state import Situation, State, Step, seconds

NEAR_M = 0.12  # close enough to the staging place
TIMEOUT_S = 300.0
STAGES_M = (0.0, 0.2, -0.15, 0.4)  # other distances, tried when there is no way to one
MAX_UNANSWERED = 3
GRIDLOCK_M = 0.15
LAST_LEG_M = 0.5  # blocked so near the end: it is the place itself that is taken


class Return(State):
    """Drives to `staging_m` before the docked pose."""

    name = "return"
    leaves_trail = True

    def __init__(self) -> None:
        self._since_ns: int | None = None
        self._stage = 0
        self._unanswered = 0
        self._no_way_ns: int | None = None  # since when no route was driven
        self._blocked_at_m: float | None = None

    def enter(self, now: Situation) -> None:
        now.desk.drop()
        self._drive: Drive | None = None
        if self._since_ns is None:
            self._since_ns = now.t_ns
            self._stage = now.run.dock_tries  # a new try comes from another place
        self._order(now)

    def tick(self, now: Situation) -> Step:
        if now.sight.world_from_docked is None:
            return give_up("the dock has not been seen yet, carry the robot there")
        if seconds(self._since_ns or 0, now.t_ns) > TIMEOUT_S:
            return give_up(f"no way back to the dock was found in {TIMEOUT_S:.0f} s")
        if self._drive is None and not now.desk.waiting:
            answer = now.desk.take()
            if answer is None or len(answer.path.points_m) == 0:
                why = "no answer" if answer is None else answer.reason
                return self._another_stage(now, why)
            self._drive, self._no_way_ns = Drive(answer.path, now, cleans=False), None
        if now.desk.waited_s(now.t_ns) > now.config.plan_timeout_s:
            self._unanswered += 1
            if self._unanswered >= MAX_UNANSWERED:
                return give_up("the planner does not answer")
            self._order(now)
        if self._drive is None:
            return Step(halt("waiting for a route"))
        wish = self._drive.tick(now)
        if self._drive.done or self._goal(now).distance_m(now.pose) < NEAR_M:
            return Step(then="dock", reason="before the dock, looking for its marker")
        if self._drive.blocked:
            return self._blocked(now, self._drive.blocked)
        return Step(wish)

    def _goal(self, now: Situation) -> SE2:
        ahead_m = now.config.staging_m + STAGES_M[self._stage % len(STAGES_M)]
        return (now.sight.world_from_docked or SE2()) @ SE2(-ahead_m)

    def _order(self, now: Situation) -> None:
        self._drive = None
        now.desk.order(now.t_ns, "route", now.pose, now.orders, self._goal(now))

    def _another_stage(self, now: Situation, why: str) -> Step:
        """Try the next distance; after a round of them, get free first. Not for ever."""
        self._stage += 1
        if self._no_way_ns is None:
            self._no_way_ns = now.t_ns
        elif seconds(self._no_way_ns, now.t_ns) > now.config.no_way_s:
            return give_up(f"no way leads to the dock ({why}); open one, or carry the robot")
        if self._stage % len(STAGES_M) == 0:
            return Step(then=Recover("enclosed", self), reason=f"no way to the dock: {why}")
        self._order(now)
        return Step(halt(f"no way to the dock yet: {why}"))

    def _blocked(self, now: Situation, why: str) -> Step:
        at_m, self._blocked_at_m = self._blocked_at_m, now.driven_m
        if self._drive is not None and self._drive.remaining_m < LAST_LEG_M:
            return self._another_stage(now, why)
        if at_m is not None and now.driven_m - at_m < GRIDLOCK_M:
            return Step(then=Recover("blocked", self), reason=why)
        self._order(now)
        return Step(halt(why))
