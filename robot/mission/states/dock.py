"""Docking by sight: find the marker, come in along its axis, end blind on the charge contact.

The last centimetres are blind because the marker no longer fits into the picture; the averaged
sightings, kept in the odometry frame, carry the robot through. Guidance is line-of-sight on the
dock's axis as in `control.follow`.
"""

from __future__ import annotations

import math

from robot.control.follow import turn_rate_radps
from robot.control.limits import clamp
from robot.control.wish import Wish, halt
from robot.geometry.se2 import SE2, wrap_angle
from robot.mission.state import Latch, Situation, State, Step, seconds
from robot.mission.states.rest import give_up

APPROACH_MPS = 0.08
TOUCH_MPS = 0.05
NEAR_M = 0.12  # from here on slowly
COMMIT_M = 0.15  # from here on no more correction of the side, the axis is kept
MAX_SIDE_M = 0.025  # off the axis at the commitment; more is a failed approach
MAX_LEAN_RAD = 0.15
BEYOND_M = 0.06  # no contact so far behind the docked pose: it was missed
BACK_M = 0.40
BACK_MPS = 0.10
FIND_S = 1.2  # looked for at the expected place before turning round
FIND_SIGHTINGS = 3
FIND_NS = 1_500_000_000
SEARCH_RADPS = 1.0
MOVED_M, MOVED_RAD = 0.25, 0.6  # the map errs less: farther off, the dock was moved
MAX_MOVES = 3
SEARCH_RAD = 2.0 * math.pi
TRY_TIMEOUT_S = 60.0
CHARGE_WAIT_S = 0.6  # the charge contact may close a little after the bumper


class Dock(State):
    """One try to dock; a failed one backs off and comes again, `dock_tries` in all."""

    name = "dock"
    guarded = False  # touching the dock is the aim

    def enter(self, now: Situation) -> None:
        now.sight.forget()
        self._latch = Latch()
        self._since_ns = now.t_ns
        self._phase, self._phase_ns = "face", now.t_ns
        self._phase_odom, self._phase_turned_rad = now.odom, now.turned_rad
        self._why_failed = ""

    def tick(self, now: Situation) -> Step:
        if now.contact.charging:
            if now.run.charges:
                return Step(then="charge", reason="docked, charging before it goes on")
            return Step(then="done", reason="docked and charging")
        if now.contact.cliff:
            return give_up("a cliff before the dock, the robot does not know where it is")
        if self._phase != "back" and seconds(self._since_ns, now.t_ns) > TRY_TIMEOUT_S:
            return self._fail(now, "docking took too long")
        if self._phase in ("face", "search") and now.latched:
            return self._fail(now, "something is in the way before the dock")
        phases = {
            "face": self._face,
            "search": self._search,
            "approach": self._approach,
            "touch": self._touch,
            "back": self._back,
        }
        return phases[self._phase](now)

    def _go(self, now: Situation, phase: str) -> None:
        self._phase, self._phase_ns = phase, now.t_ns
        self._phase_odom, self._phase_turned_rad = now.odom, now.turned_rad

    # ------------------------------------------------------------------ finding the marker

    def _found(self, now: Situation) -> bool:
        return now.sight.sightings(now.t_ns - FIND_NS) >= FIND_SIGHTINGS

    def _face(self, now: Situation) -> Step:
        """Turn to where the map says the dock is, and wait a moment."""
        dock = now.pose.inverse() @ (now.sight.world_from_docked or SE2())
        error = math.atan2(dock.y_m, dock.x_m)
        if abs(error) > 0.08:
            self._phase_ns = now.t_ns
            return Step(Wish(0.0, turn_rate_radps(error, now.robot, 0.8), reason="facing the dock"))
        if self._found(now):
            return self._sighted(now)
        if seconds(self._phase_ns, now.t_ns) > FIND_S:
            self._go(now, "search")
        return Step(halt("looking for the dock's marker"))

    def _search(self, now: Situation) -> Step:
        """One slow turn; a marker seen on the way stops it."""
        if self._found(now):
            return self._sighted(now)
        if now.turned_rad - self._phase_turned_rad > SEARCH_RAD:
            return self._fail(now, "the dock's marker was not seen")
        return Step(Wish(0.0, SEARCH_RADPS, reason="searching for the dock's marker"))

    def _sighted(self, now: Situation) -> Step:
        """Come in; but where the dock stands elsewhere than the map says, go before it first."""
        seen = now.sight.docked(now.t_ns, 0.0, 1e3)  # by what is seen alone
        known = now.sight.world_from_docked
        if seen is not None and known is not None and now.run.dock_moves < MAX_MOVES:
            world_from_docked = now.pose @ now.odom.inverse() @ seen
            off = known.inverse() @ world_from_docked
            if math.hypot(off.x_m, off.y_m) > MOVED_M or abs(off.yaw_rad) > MOVED_RAD:
                now.run.dock_moves += 1
                now.sight.world_from_docked = world_from_docked
                return Step(then="return", reason="the dock was moved, going before its new place")
        self._go(now, "approach")
        return Step(halt("the dock's marker is in sight"))

    # ------------------------------------------------------------------ coming in

    def _docked_from_base(self, now: Situation) -> SE2 | None:
        """Where the robot stands in the frame of the docked pose: x < 0 before the dock."""
        docked_yaw = (now.sight.world_from_docked or SE2()).yaw_rad
        map_yaw = wrap_angle(now.odom.yaw_rad - now.pose.yaw_rad + docked_yaw)
        docked = now.sight.docked(now.t_ns, map_yaw, max(0.03, now.yaw_sigma_rad))
        return None if docked is None else docked.inverse() @ now.odom

    def _approach(self, now: Situation) -> Step:
        at = self._docked_from_base(now)
        if at is None:
            return self._fail(now, "the dock's marker was lost")
        if now.touching or now.latched:
            self._go(now, "touch")
            return Step(halt("touching something"))
        if at.x_m > BEYOND_M:
            return self._fail(now, "the charge contact did not close")
        away_m = -at.x_m
        committed = away_m < COMMIT_M
        off_axis = abs(at.y_m) > MAX_SIDE_M or abs(at.yaw_rad) > MAX_LEAN_RAD
        if off_axis and 0.5 * COMMIT_M < away_m < COMMIT_M:
            return self._fail(now, "the approach was off the dock's axis")
        reach_m = max(0.12, 0.4 * away_m)
        wished = 0.0 if committed else -clamp(math.atan2(at.y_m, reach_m), 0.7)
        error = wrap_angle(wished - at.yaw_rad)
        if abs(error) > 0.25 and not committed:
            turn = turn_rate_radps(error, now.robot, 0.6)
            return Step(Wish(0.0, turn, reason="aligning with the dock"))
        v = TOUCH_MPS if away_m < NEAR_M else APPROACH_MPS
        w = clamp(now.control.heading_gain_per_s * 0.5 * error, 0.5)
        return Step(Wish(v, w, reason="coming into the dock"))

    def _touch(self, now: Situation) -> Step:
        """Something was touched: the dock, if the charge contact closes now."""
        if seconds(self._phase_ns, now.t_ns) > CHARGE_WAIT_S:
            return self._fail(now, "something was touched that does not charge")
        return Step(halt("waiting for the charge contact"))

    # ------------------------------------------------------------------ trying again

    def _fail(self, now: Situation, why: str) -> Step:
        self._why_failed = why
        now.run.dock_tries += 1
        self._go(now, "back")
        return Step(halt(why))

    def _back(self, now: Situation) -> Step:
        """Back out to where the marker can be seen, then come again by the map."""
        if not self._latch.clear(now, "backing off from the dock"):
            return Step(halt("waiting for the motor controller"))
        backed = self._phase_odom.distance_m(now.odom) >= BACK_M
        if backed or seconds(self._phase_ns, now.t_ns) > BACK_M / BACK_MPS + 3.0:
            tries = now.run.dock_tries
            if tries >= now.config.dock_tries:  # it waits before the dock
                return give_up(f"docking failed {tries} times: {self._why_failed}")
            return Step(then="return", reason=f"{self._why_failed}, trying again")
        return Step(Wish(-BACK_MPS, 0.0, reason="backing off from the dock"))
