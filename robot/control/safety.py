"""The one gate that every drive command passes. Default deny.

Nothing moves until wheels, contacts and link have been heard; what is old counts as unheard. Then
the speed is bounded by what the sensors can see ahead: v*t + v^2/(2a) within the free distance.
Only one thing is never denied while the drive can be trusted: backing away slowly. Lines that
people have drawn are stopped before, however slow; wheel-only driving creeps without sight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from robot.config import ControlConfig, RobotConfig
from robot.control.keepout import KeepOut
from robot.control.limits import Ramp, braking_speed_mps, clamp, stopping_distance_m
from robot.control.sight import Corridor, Sight
from robot.control.wish import Wish
from robot.geometry.se2 import SE2
from robot.messages import Contact, DriveCommand, LinkState, Seen

TURNING_MPS = 0.02  # slower than this is turning in place, which sweeps no floor
BACK_TURN = 1.9  # of the 2 at which one wheel stands while the other backs
OPEN = Corridor(math.inf, math.inf)


@dataclass(frozen=True, slots=True)
class Verdict:
    """What the gate thought of the last wish; empty strings: it had nothing against it."""

    denied: str = ""
    slowed: str = ""
    free_m: float = math.inf  # along the wished arc, until the body touches


class SafetyGate:
    """Makes drive commands out of wishes."""

    def __init__(self, control: ControlConfig, robot: RobotConfig) -> None:
        self._control = control
        self._robot = robot
        self._ramp = Ramp(control, robot)
        self._contact: Contact | None = None
        self._link: LinkState | None = None
        self._seen_ns: int | None = None
        self._tick_ns: int | None = None
        self.sight = Sight(control, robot)
        self.keep_out = KeepOut(control, robot)
        self.verdict = Verdict("nothing has been heard yet")

    def contact(self, event: Contact) -> None:
        """Remember the switches."""
        self._contact = event

    def link(self, event: LinkState) -> None:
        """Remember the state of the motor controller."""
        self._link = event

    def see(self, seen: Seen, odom_from_base: SE2) -> None:
        """Remember what a frame showed; the pose is that of the time of the frame."""
        self._seen_ns = max(seen.t_ns, self._seen_ns or 0)
        self.sight.see(seen.t_ns, odom_from_base, seen.scan)

    def check(
        self, t_ns: int, wish: Wish, odom_from_base: SE2, wheels_ns: int | None, localised: bool
    ) -> DriveCommand:
        """The order for this tick.

        `odom_from_base` is the pose now in the frame of `see`, `wheels_ns` the time of the newest
        wheel travel (None: never). Brush and fan run only while `localised`.
        """
        dt_s = 0.0 if self._tick_ns is None else (t_ns - self._tick_ns) * 1e-9
        self._tick_ns = t_ns
        denied = self._denial(t_ns, wish, wheels_ns)
        running = localised and not wish.wheel_only
        if denied:
            self.verdict = Verdict(denied=denied)
            self._ramp.force(0.0, 0.0)
            return self._order(t_ns, 0.0, 0.0, wish, denied, running=False)
        v, w = self._ramp.step(wish.v_mps, wish.yaw_rate_radps, dt_s)
        if self._touching():  # neither wheel may push forward
            v = min(v, 0.0)
            w = clamp(w, BACK_TURN * -v / self._robot.track_width_m)
            self._ramp.force(v, w)
        cap_mps, slowed, free_m = self._cap(t_ns, v, w, wish, odom_from_base)
        self.verdict = Verdict(slowed=slowed if abs(v) > cap_mps else "", free_m=free_m)
        if abs(v) > cap_mps:
            if cap_mps > TURNING_MPS:  # the arc stays the same; standing it may turn
                w *= cap_mps / abs(v)
            v = math.copysign(cap_mps, v)
            self._ramp.force(v, w)
        return self._order(t_ns, v, w, wish, self.verdict.slowed, running=running)

    # ------------------------------------------------------------------ rules

    def _denial(self, t_ns: int, wish: Wish, wheels_ns: int | None) -> str:
        """Why nothing may move at all, or empty."""
        control, link, contact = self._control, self._link, self._contact
        if link is None or _age_s(t_ns, link.t_ns) > control.link_stale_s:
            return "no news from the motor controller"
        if not link.connected:
            return "the link to the motor controller is down"
        if link.stop_reason:
            return f"the motor controller holds a stop: {link.stop_reason}"
        if contact is None or _age_s(t_ns, contact.t_ns) > control.contact_stale_s:
            return "no news from the contact switches"
        if contact.wheel_drop:
            return "a wheel hangs in the air"
        if wheels_ns is None or _age_s(t_ns, wheels_ns) > control.wheels_stale_s:
            return "no news from the wheels"
        if self._backs_away(wish):
            return ""
        if contact.cliff:
            return "a cliff is ahead, only backing is allowed"
        if self._touching():
            return "the bumper is pressed, only backing is allowed"
        if wish.wheel_only:
            return ""
        if self._seen_ns is None or _age_s(t_ns, self._seen_ns) > control.seen_stop_s:
            return "nothing has been seen for too long"
        return ""

    def _touching(self) -> bool:
        contact = self._contact
        return contact is not None and (contact.bump_left or contact.bump_right or contact.cliff)

    def _backs_away(self, wish: Wish) -> bool:
        """Neither wheel turns forward: the way out of every contact."""
        turn_mps = 0.5 * self._robot.track_width_m * abs(wish.yaw_rate_radps)
        return wish.v_mps < 0.0 and turn_mps <= -wish.v_mps

    def _cap(
        self, t_ns: int, v: float, w: float, wish: Wish, odom_from_base: SE2
    ) -> tuple[float, str, float]:
        """Highest allowed speed, the rule that sets it, and the free distance on the arc."""
        control, wished_mps = self._control, wish.v_mps
        direction = 1 if wished_mps >= 0.0 else -1
        probe = v if abs(v) > TURNING_MPS else math.copysign(TURNING_MPS, wished_mps)
        moving = abs(v) > 0.0 or abs(wished_mps) > 0.0
        corridor, line_m = OPEN, math.inf
        if moving:
            corridor = self.sight.corridor(odom_from_base, direction, w / probe)
            line_m = self.keep_out.free_m(odom_from_base, direction, w / probe)
        cap, why = self._robot.cruise_mps, ""
        if wish.wheel_only:
            cap, why = control.wheel_only_mps, "driving by the wheels alone"
        if (v < 0.0 or wished_mps < 0.0) and control.back_mps < cap:
            cap, why = control.back_mps, "backing is slow"
        if _age_s(t_ns, self._seen_ns or 0) > control.seen_slow_s and cap > control.stale_mps:
            cap, why = control.stale_mps, "the last frame is old"
        rules = (
            (line_m, 0.0, "a line that must not be crossed is ahead"),
            (corridor.free_m, control.touch_mps, "an obstacle is ahead"),
            (corridor.graze_m, control.near_mps, "an obstacle is close beside the way"),
        )
        for distance_m, least_mps, reason in rules:
            room_m = distance_m - control.stop_gap_m
            sight_mps = braking_speed_mps(room_m, control.brake_mps2, control.reaction_s)
            if max(least_mps, sight_mps) < cap:
                cap, why = max(least_mps, sight_mps), reason
        stop_m = stopping_distance_m(v, control.brake_mps2, control.reaction_s)
        ahead_unknown = v > control.unknown_mps and not self.sight.knows_free(
            odom_from_base, stop_m
        )
        if ahead_unknown and control.unknown_mps < cap:
            cap, why = control.unknown_mps, "the floor ahead has not been seen"
        return cap, why, min(corridor.free_m, line_m)

    def _order(
        self, t_ns: int, v: float, w: float, wish: Wish, why: str, *, running: bool
    ) -> DriveCommand:
        return DriveCommand(
            t_ns=t_ns,
            v_mps=v,
            yaw_rate_radps=w,
            brush=min(1.0, max(0.0, wish.brush)) if running else 0.0,
            fan=min(1.0, max(0.0, wish.fan)) if running else 0.0,
            valid_for_ms=self._control.valid_for_ms,
            reason=why or wish.reason,
        )


def _age_s(now_ns: int, then_ns: int) -> float:
    return (now_ns - then_ns) * 1e-9
