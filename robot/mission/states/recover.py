"""Getting out of trouble: back off, remember what was touched, turn, go on. Bounded (`ladder`)."""

from __future__ import annotations

import math

import numpy as np

from robot.control.follow import turn_rate_radps
from robot.control.wish import Wish, halt
from robot.geometry.se2 import SE2, wrap_angle
from robot.mission.drive import back_round
from robot.mission.ladder import (
    RETRACE_FROM,
    RUNGS,
    SAYS,
    WIGGLE_FROM,
    Kind,
    Phase,
    back_off_m,
    exhausted,
)
from robot.mission.marks import GAP_M, edge, line, over_edge_rad, touched
from robot.mission.retrace import Retrace
from robot.mission.state import Latch, Situation, State, Step, Trouble, seconds
from robot.mission.states.rest import give_up
from robot.mission.touch import touch

BACK_MPS = 0.08
TURN_DONE_RAD = 0.1
PIVOT_FREE_S = 0.2
WIGGLE_RADPS, WIGGLE_MPS, WIGGLE_EVERY_S = 1.0, 0.06, 0.6
RETRACE_M = 0.4
RETRACE_ENCLOSED_M = 1.5
GRAZE_BACK_M, GRAZE_TURN_RAD = 0.03, 0.25  # a wall brushed with one side needs no more
TOUCH_HALF_M = 0.025  # half the width of what is marked at least,
TOUCHED_MOST = 3  # and so often it doubles with touches so near to one another:
TOUCHED_NEAR_M = 0.3
HELD_MOST = 2
HELD_HALF_M = 0.15  # for each time that its wheels were held before: a carpet's edge, a cable
FORGET_M = 1.0
WORKS_ON: set[Kind] = {"bump", "blocked"}  # its work between two of these is no time of trouble
CALM_S, AWAY_M = 12.0, 0.6  # another trouble begins after so long, so far from the last,
WORK_M2 = 0.1  # or after so much that was swept


class Recover(State):
    """One try to get free; `resume` goes on afterwards with a new plan.

    Every try since the robot last drove freely backs off farther and turns more.
    """

    name = "recover"
    guarded = False

    def __init__(self, kind: Kind, resume: State) -> None:
        self._kind = kind
        self._resume = resume
        self._latch = Latch()

    def enter(self, now: Situation) -> None:
        now.desk.drop()
        if now.run.trouble.tries == 0 or _is_another(now):
            now.run.trouble = Trouble(now.t_ns, now.odom, now.swept.area_m2)
        trouble = now.run.trouble
        if trouble.kinds and trouble.kinds | {self._kind} <= WORKS_ON:
            trouble.since_ns += now.t_ns - max(trouble.over_ns, trouble.since_ns)
        if self._kind == "enclosed":  # it came in, so there is a way: its own marks may be wrong
            now.grid.forget_touches(now.pose, FORGET_M)
        trouble.tries += 1
        trouble.kinds.add(self._kind)
        self._try, self._stop = trouble.tries, now.link.stop_reason
        if self._kind == "stop":
            trouble.stop = self._stop
        self._next(now, "wait" if self._kind == "blocked" and self._try == 1 else "clear")
        self._pivoted, self._touched_ns = False, now.t_ns
        self._pivot_way = 1.0 if self._try % 2 else -1.0
        self._turn_to_rad = now.odom.yaw_rad + self._turn_rad(now)
        self._back_m = back_off_m(now, self._kind, self._try)
        if self._grazes(now):
            self._back_m = GRAZE_BACK_M
        now.run.trail.cut(GRAZE_BACK_M)
        self._mark(now)
        self._hopeless = exhausted(now, self._kind, self._try, self._stop)

    def tick(self, now: Situation) -> Step:
        if self._hopeless:
            return give_up(self._hopeless)
        if self._phase == "wait":
            return self._wait(now)
        if self._phase == "clear":
            if self._latch.clear(now, f"the robot {SAYS[self._kind]} and backs off"):
                self._next(now, "back")
            elif self._spent(now):
                return give_up(f"the motor controller keeps its stop: {now.link.stop_reason}")
            return Step(halt("waiting for the motor controller"))
        if now.latched:
            self._stop = now.link.stop_reason
        if not self._latch.clear(now, "the stop came again while backing off"):
            if seconds(self._since_ns, now.t_ns) > 2.0 * RUNGS["clear"].limit_s:
                return give_up(f"the motor controller keeps its stop: {now.link.stop_reason}")
            return Step(halt("waiting for the motor controller"))
        return {
            "back": self._back,
            "pivot": self._pivot,
            "turn": self._turn,
            "wiggle": self._wiggle,
        }[self._phase](now)

    def _wait(self, now: Situation) -> Step:
        """Whoever stands in the way may go by itself."""
        if self._spent(now):
            self._next(now, "clear")
        return Step(halt("waiting whether the way becomes free"))

    def _back(self, now: Situation) -> Step:
        # Nothing feels what is behind: wheels that turn in vain there are taken for a way.
        against = not now.touching and now.gate.verdict.free_m <= 0.0
        back_m = min(self._back_m, GRAZE_BACK_M) if against else self._back_m
        if now.driven_m - self._from_m >= back_m or self._spent(now):
            now.run.trouble.back_m += now.driven_m - self._from_m
            self._next(now, "pivot" if now.touching else "turn")
        return Step(Wish(-BACK_MPS, 0.0, reason="backing off"))

    def _pivot(self, now: Situation) -> Step:
        """Still touching although it backed: something is behind, too. One wheel backs round."""
        if now.touching:
            self._touched_ns = now.t_ns
        if seconds(self._touched_ns, now.t_ns) > PIVOT_FREE_S or self._spent(now):
            self._turn_to_rad = now.odom.yaw_rad
            self._next(now, "turn")
        if now.contact.bump_left != now.contact.bump_right:
            self._pivot_way = -1.0 if now.contact.bump_left else 1.0
        return Step(back_round(now.robot, self._pivot_way, "turning out of a corner"))

    def _turn(self, now: Situation) -> Step:
        error = wrap_angle(self._turn_to_rad - now.odom.yaw_rad)
        if now.touching and not self._pivoted:
            self._pivoted = True
            self._touched_ns = now.t_ns
            self._next(now, "pivot")
            return Step(halt("touching again"))
        stands = abs(error) < TURN_DONE_RAD or self._spent(now)
        if stands or now.touching or now.contact.cliff:
            held = self._kind in ("stuck", "stop", "slip") and self._try >= WIGGLE_FROM
            if held and not now.touching and not now.contact.cliff:
                self._next(now, "wiggle")
                return Step(halt("held by something"))
            return self._over(now)
        return Step(Wish(0.0, turn_rate_radps(error, now.robot), reason="turning away"))

    def _wiggle(self, now: Situation) -> Step:
        """Short arcs to and fro: off a cable, out of a carpet's edge."""
        if self._spent(now) or now.touching or now.contact.cliff:
            return self._over(now)
        swing = int(seconds(self._since_ns, now.t_ns) / WIGGLE_EVERY_S)
        way = 1.0 if swing % 2 else -1.0
        v_mps = WIGGLE_MPS if swing % 4 == 3 else -WIGGLE_MPS
        return Step(Wish(v_mps, way * WIGGLE_RADPS, reason="wiggling"))

    def _over(self, now: Situation) -> Step:
        """This try is done: a new plan, or the own way back before it."""
        now.run.trouble.over_at_m, now.run.trouble.over_ns = now.driven_m, now.t_ns
        if self._goes_back():
            distance_m = RETRACE_M * (self._try - RETRACE_FROM + 1)
            if self._kind == "enclosed":
                distance_m = RETRACE_ENCLOSED_M
            back = Retrace(distance_m, self._resume)
            return Step(then=back, reason="backing off is not enough, going back its own way")
        return Step(then=self._resume, reason="free again, making a new plan")

    def _goes_back(self) -> bool:
        """Whether the way it came is tried now: in turns with new plans, which have seen more."""
        if self._kind == "enclosed":
            return self._try > 1
        return self._try >= RETRACE_FROM and (self._try - RETRACE_FROM) % 2 == 0

    def _next(self, now: Situation, phase: Phase) -> None:
        self._phase: Phase = phase
        self._since_ns, self._from_m = now.t_ns, now.driven_m

    def _spent(self, now: Situation) -> bool:
        """Whether this rung has had its time or its way."""
        rung = RUNGS[self._phase]
        if seconds(self._since_ns, now.t_ns) > rung.limit_s:
            return True
        return now.driven_m - self._from_m > rung.limit_m > 0.0

    def _turn_rad(self, now: Situation) -> float:
        """Away from what was touched; farther at each try, in alternate directions."""
        if self._try == 1 and self._kind in ("blocked", "stop", "slip"):
            return 0.0
        angle = min(0.5 * self._try, 0.9 * math.pi)
        if self._grazes(now):
            angle = GRAZE_TURN_RAD
        left, right = _sides(now)
        if left != right:
            return -angle if left else angle
        return angle if self._try % 2 else -angle

    def _grazes(self, now: Situation) -> bool:
        """Whether this is the first touch here, and with one side only."""
        one_side = now.contact.bump_left != now.contact.bump_right
        return self._kind == "bump" and self._try == 1 and one_side

    def _mark(self, now: Situation) -> None:
        """Write into the map what was met, so that the next plan avoids it."""
        held = 0
        if self._kind in ("stop", "slip"):
            held = _times_before(now, now.run.held_at, AWAY_M)
            now.grid.feel(now.pose, now.robot.track_width_m / 2.0, 1.0)
        if self._kind in ("bump", "stuck") or held:
            times = _times_before(now, now.run.touched_at, TOUCHED_NEAR_M)
            half_m = TOUCH_HALF_M * 2.0 ** min(times, TOUCHED_MOST)
            last = touch(now.contact, now.odom)
            now.grid.mark_obstacle(*touched(now, last, half_m))
            now.run.touches.appendleft(last)
            if held:
                now.grid.mark_obstacle(_across(now, HELD_HALF_M * min(held, HELD_MOST)))
        elif self._kind == "cliff":
            now.grid.mark_edge(edge(now))
        elif self._kind == "blocked" and _times_before(now, now.run.blocked_at, TOUCHED_NEAR_M):
            points = now.gate.sight.nearest_ahead_m(now.odom, now.robot.radius_m / 2.0, 1)
            world_from_odom = now.pose @ now.odom.inverse()
            now.grid.mark_obstacle(world_from_odom.apply(points))


def _sides(now: Situation) -> tuple[bool, bool]:
    """Whether something is met on the left, and on the right."""
    over = over_edge_rad(now)
    left, right = bool((over > 0.0).any()), bool((over < 0.0).any())
    return now.contact.bump_left or left, now.contact.bump_right or right


def _times_before(now: Situation, places: list[SE2], within_m: float) -> int:
    """How many of the `places` (in odom) are about here; this one is added to them."""
    before = sum(now.odom.distance_m(place) < within_m for place in places)
    places.append(now.odom)
    return before


def _is_another(now: Situation) -> bool:
    """Whether the robot has driven on freely since the last trouble, and got on with its work."""
    last = now.run.trouble
    freely = now.driven_m - last.over_at_m > now.config.recover_reset_m
    calm = seconds(last.over_ns, now.t_ns) > CALM_S
    away = now.odom.distance_m(last.place) > AWAY_M
    return freely and (calm or away or now.swept.area_m2 - last.swept_m2 > WORK_M2)


def _across(now: Situation, half_m: float) -> np.ndarray:
    """Points (n, 2) of `world` on a line before the robot, across its way."""
    y = line(-half_m, half_m)
    ahead = np.full(len(y), now.robot.radius_m + GAP_M)
    return now.pose.apply(np.stack([ahead, y], axis=-1))
