"""Nothing is seen (a dark room, a covered lens, no answer of the eyes): creep home by the wheels.

The brush is off and the speed at most `control.wheel_only_mps`: the bumper's speed. How far
odometry may be believed is bounded in metres and in seconds; then it stops and says why.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robot.control.limits import clamp
from robot.control.wish import Wish, halt
from robot.geometry.se2 import SE2, wrap_angle
from robot.messages import Seen
from robot.mission.drive import Drive
from robot.mission.state import Latch, Name, Situation, State, Step, seconds
from robot.mission.states.rest import give_up

WHY = "nothing is seen: a dark room, a covered lens or no picture"
MAX_TOUCHES = 3
BACK_M, BACK_S = 0.08, 2.5
LOOK_RADPS = 0.4
IN_MPS = 0.05  # into the dock
BEYOND_M = 0.06
MAX_SIDE_M = 0.10  # off the dock's axis: not worth a try


class WheelOnly(State):
    """Wait for the sight; then the way home by the map; then one blind try to dock."""

    name = "wheel-only"
    guarded = False

    def __init__(self, resume: State | Name) -> None:
        self._resume = resume

    def enter(self, now: Situation) -> None:
        now.desk.drop()
        self._latch = Latch()
        self._since_ns, self._from_m = now.t_ns, now.driven_m
        self._phase, self._phase_odom, self._phase_ns = "wait", now.odom, now.t_ns
        self._drive: Drive | None = None
        self._touches = 0

    def tick(self, now: Situation) -> Step:
        if now.contact.charging and self._phase != "wait":
            return Step(then="done", reason="docked and charging, by the wheels alone")
        if now.blind_s < now.config.blind_after_s / 2.0:
            return Step(then=self._resume, reason="it sees again")
        limit_m, limit_s = now.config.blind_limit_m, now.config.blind_limit_s
        driven_m = now.driven_m - self._from_m
        if driven_m > limit_m or seconds(self._since_ns, now.t_ns) > limit_s:
            return give_up(f"{WHY}; it stopped after {driven_m:.1f} m by the wheels alone")
        if now.contact.cliff:
            return give_up(f"{WHY}; it stopped at a cliff")
        return {"wait": self._wait, "home": self._home, "back": self._back, "in": self._in}[
            self._phase
        ](now)

    def _next(self, now: Situation, phase: str) -> None:
        self._phase, self._phase_odom, self._phase_ns = phase, now.odom, now.t_ns

    def _wait(self, now: Situation) -> Step:
        """It may be a plain wall right before it: look elsewhere."""
        if seconds(self._since_ns, now.t_ns) < now.config.blind_wait_s:
            if now.contact.charging or now.touching or now.latched:
                return Step(halt("nothing is seen, waiting"))
            turn = Wish(0.0, LOOK_RADPS, reason="nothing is seen, looking elsewhere")
            return Step(replace(turn, wheel_only=True))
        if now.contact.charging:
            return give_up(f"{WHY}; it stays on its dock")
        if now.sight.world_from_docked is None:
            return give_up(f"{WHY}; it stopped, as it knows no way home")
        if now.health == "lost":
            return give_up(f"{WHY}; it stopped, as it does not know where it is")
        self._order(now)
        return Step(halt("nothing is seen, going home by the wheels"))

    def _order(self, now: Situation) -> None:
        self._drive = None
        docked = now.sight.world_from_docked or SE2()
        staging = docked @ SE2(-now.config.staging_m)
        now.desk.order(now.t_ns, "route", now.pose, now.orders, staging)
        self._next(now, "home")

    def _home(self, now: Situation) -> Step:
        if now.touching or now.latched:
            return self._touched(now)
        answer = now.desk.take()
        if answer is not None:
            if len(answer.path.points_m) == 0:
                return give_up(f"{WHY}; it stopped, as no way leads home: {answer.reason}")
            self._drive = Drive(answer.path, now, cleans=False)
        if now.desk.waited_s(now.t_ns) > now.config.plan_timeout_s:
            return give_up(f"{WHY}; it stopped, as the planner does not answer")
        if self._drive is None:
            return Step(halt("waiting for a route"))
        wish = self._drive.tick(now)
        if self._drive.done:
            self._next(now, "in")
            return Step(halt("before the dock"))
        if self._drive.blocked:
            return self._touched(now)
        return Step(_creeping(wish, now))

    def _touched(self, now: Situation) -> Step:
        """Back a little and ask for another way, some times."""
        self._touches += 1
        if self._touches > MAX_TOUCHES:
            return give_up(f"{WHY}; it stopped, as the way home is blocked")
        self._next(now, "back")
        return Step(halt("touched something"))

    def _back(self, now: Situation) -> Step:
        if not self._latch.clear(now, "backing off without sight"):
            return Step(halt("waiting for the motor controller"))
        backed = self._phase_odom.distance_m(now.odom) >= BACK_M
        if backed or seconds(self._phase_ns, now.t_ns) > BACK_S:
            self._order(now)
        return Step(Wish(-IN_MPS, 0.0, reason="backing off without sight", wheel_only=True))

    def _in(self, now: Situation) -> Step:
        """Along the dock's axis by the map, until it charges or should have."""
        at = (now.sight.world_from_docked or SE2()).inverse() @ now.pose
        missed = at.x_m > BEYOND_M or abs(at.y_m) > MAX_SIDE_M
        if missed or now.touching or now.latched:
            return give_up(f"{WHY}; it came to its dock and missed it: carry it the last step")
        error = wrap_angle(-clamp(4.0 * at.y_m, 0.4) - at.yaw_rad)
        if abs(error) > 0.2:
            turn = clamp(2.0 * error, 0.5)
            return Step(Wish(0.0, turn, reason="turning to the dock", wheel_only=True))
        turn = clamp(2.0 * error, 0.3)
        return Step(Wish(IN_MPS, turn, reason="into the dock without sight", wheel_only=True))


def tells_something(seen: Seen, least_quality: float) -> bool:
    """Whether a frame is worth anything: near a plain wall little is seen, in the dark nothing."""
    if seen.quality >= least_quality or seen.landmarks or seen.motion is not None:
        return True
    return bool(np.isfinite(seen.scan.range_m).any() or (seen.scan.clear_m > 0.0).any())


def _creeping(wish: Wish, now: Situation) -> Wish:
    """The same arc, slowly, with everything else off."""
    most = now.control.wheel_only_mps
    scale = min(1.0, most / abs(wish.v_mps)) if abs(wish.v_mps) > 0.0 else 1.0
    return replace(
        wish,
        v_mps=wish.v_mps * scale,
        yaw_rate_radps=wish.yaw_rate_radps * scale,
        brush=0.0,
        fan=0.0,
        reason="going home by the wheels alone",
        wheel_only=True,
    )
