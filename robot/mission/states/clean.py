"""Sweeping: plan, drive, plan again when done, blocked, or when the map has grown.

What is to be swept is the run's job; the states differ in their names only.
"""

from __future__ import annotations

from robot.control.wish import halt
from robot.messages import Planned
from robot.mission.drive import Drive
from robot.mission.hug import Hug
from robot.mission.job import JobKind
from robot.mission.state import Situation, State, Step, seconds
from robot.mission.states.recover import Recover
from robot.mission.states.rest import Idle, give_up

LOOKS = 2  # times to look around again when there is no plan at the very beginning
ENCLOSED_M2, ENCLOSED_SHARE = 0.5, 0.3  # of so much that was swept, less is reached: closed in
GRIDLOCK_M = 0.15  # blocked again before so much was driven: planning alone does not help
MAX_UNANSWERED = 3


class Clean(State):
    """Sweeps until nothing reachable is left."""

    name = "clean"
    leaves_trail = True

    def __init__(self) -> None:
        self._drive: Drive | None = None
        self._hug = Hug()
        self._unanswered = 0
        self._ended = False  # the last plan was driven to its end
        self._blocked_at_m: float | None = None

    def enter(self, now: Situation) -> None:
        now.desk.drop()
        self._drive, self._hug = None, Hug()
        self._ended = False
        self._swept_m2 = now.swept.area_m2
        self._free_m2 = now.known_free_m2
        self._planned_ns = now.t_ns
        self._order(now)

    def bears(self, now: Situation) -> bool:
        return self._drive is not None and self._hug.feels(now, self._drive.lateral_m)

    def tick(self, now: Situation) -> Step:
        if self._hug.swinging:
            return Step(self._hug.swing(now))
        answer = now.desk.take()
        if answer is not None:
            step = self._begin(now, answer)
            if step is not None:
                return step
        if now.desk.waited_s(now.t_ns) > now.config.plan_timeout_s:
            self._unanswered += 1
            if self._unanswered >= MAX_UNANSWERED:
                return give_up("the planner does not answer")
            self._order(now)
        if self._drive is None:
            return Step(halt("waiting for a plan"))
        return self._go_on(now, self._drive)

    # ------------------------------------------------------------------ plans

    def _order(self, now: Situation) -> None:
        job = now.run.job
        area = None if job.whole else job.area
        now.desk.order(now.t_ns, "coverage", now.pose, now.orders, area=area)

    def _begin(self, now: Situation, answer: Planned) -> Step | None:
        """Take a new plan, or end the cleaning; None while there is work."""
        self._unanswered = 0
        swept_m2 = now.swept.area_m2
        now.run.due_m2 = swept_m2 + answer.remaining_m2
        if swept_m2 > ENCLOSED_M2 and answer.reached_m2 < ENCLOSED_SHARE * swept_m2:
            reason = "most of what it has swept is suddenly out of reach"
            return Step(then=Recover("enclosed", self), reason=reason)
        if len(answer.path.points_m) == 0:
            return self._without_work(now, answer)
        if self._drive is None and self._ended:
            self._count_fruitless(now)
            if now.run.fruitless_plans and answer.remaining_m2 < now.config.done_m2:
                return finished(now, "the floor is clean but for specks")
            if now.run.fruitless_plans >= now.config.fruitless_plans:
                return finished(now, "the last plans brought nothing new, so that is all")
        now.run.plans += 1
        self._planned_ns = now.t_ns
        self._free_m2 = now.desk.known_free_m2
        self._drive, self._ended = Drive(answer.path, now, cleans=True), False
        return None

    def _without_work(self, now: Situation, answer: Planned) -> Step:
        if now.run.plans == 0 and now.run.looks <= LOOKS:
            return Step(then="look", reason=f"no plan yet ({answer.reason}), looking again")
        if now.run.plans == 0:
            return finished(now, f"nothing to clean in {now.run.job.what}: {answer.reason}")
        return finished(now, f"finished {now.run.job.what}: {answer.reason}")

    def _count_fruitless(self, now: Situation) -> None:
        """A plan that neither swept nor discovered anything was fruitless."""
        if now.run.plans == 0:
            return
        swept_m2 = now.swept.area_m2 - self._swept_m2
        found_m2 = now.desk.known_free_m2 - self._free_m2
        fruitful = max(swept_m2, found_m2) >= now.config.fruitful_m2
        now.run.fruitless_plans = 0 if fruitful else now.run.fruitless_plans + 1
        self._swept_m2 = now.swept.area_m2

    # ------------------------------------------------------------------ driving

    def _go_on(self, now: Situation, drive: Drive) -> Step:
        self._hug.look(now, drive.lateral_m)
        wish = self._hug.careful(now, drive.tick(now, self._hug.aside_m))
        if drive.blocked:
            return self._blocked(now, drive.blocked)
        if drive.done:
            self._drive, self._ended = None, True
            self._order(now)
            return Step(halt("the plan is done, making the next"))
        grown_m2 = now.known_free_m2 - self._free_m2
        age_s = seconds(self._planned_ns, now.t_ns)
        due = grown_m2 >= now.config.replan_growth_m2 and age_s >= now.config.replan_every_s
        if due and not now.desk.waiting:
            self._order(now)  # the robot drives on meanwhile; the new plan starts where it is
        return Step(wish)

    def _blocked(self, now: Situation, why: str) -> Step:
        at_m, self._blocked_at_m = self._blocked_at_m, now.driven_m
        if at_m is not None and now.driven_m - at_m < GRIDLOCK_M:
            return Step(then=Recover("blocked", self), reason=why)
        self._drive = None
        self._order(now)
        return Step(halt(why))


class Spot(Clean):
    """Sweeps around the place where it was asked."""

    name = "spot"


class Zone(Clean):
    """Sweeps some rectangles."""

    name = "zone"


class Room(Clean):
    """Sweeps some rooms."""

    name = "room"


WORK: dict[JobKind, type[Clean]] = {"clean": Clean, "spot": Spot, "zone": Zone, "room": Room}


def finished(now: Situation, reason: str) -> Step:
    """Home; but who was put down beside the work, or knows no dock, stays."""
    run = now.run
    if not run.from_dock and (not run.job.whole or now.sight.world_from_docked is None):
        return Step(then=Idle(), reason=f"{reason}; waiting here")
    return Step(then="return", reason=reason)
