"""The state machine: requests, the watch over every active state, and the changes."""

from __future__ import annotations

import math
from collections import deque

from robot.control.wish import Wish
from robot.messages import MissionState, Request, StopOrder
from robot.mission.clean import Clean
from robot.mission.dock import Dock
from robot.mission.look import Look
from robot.mission.recover import Kind, Recover
from robot.mission.rest import Done, Error, Idle, Paused, Starting
from robot.mission.state import Name, RunRecord, Situation, State, seconds
from robot.mission.travel import Return
from robot.mission.undock import Undock

REPORT_NS = 1_000_000_000
STATES: dict[Name, type[State]] = {
    "undock": Undock,
    "look": Look,
    "clean": Clean,
    "return": Return,
    "dock": Dock,
    "done": Done,
}


class Mission:
    """What the robot is about, and why."""

    def __init__(self) -> None:
        self.state: State = Idle()
        self.reason = "switched on"
        self.run = RunRecord()
        self._requests: deque[Request] = deque()
        self._reported_ns: int | None = None
        self._moving_since: tuple[int, float, float] | None = None
        self._denied_ns: int | None = None

    def request(self, request: Request) -> None:
        """Take a request in; it is carried out at the next tick."""
        self._requests.append(request)

    def tick(self, now: Situation) -> Wish:
        """One beat: the wish for the wheels; other commands are added to `now.orders`."""
        now.run = self.run
        while self._requests:
            self._carry_out(self._requests.popleft(), now)
        if self.state.active:
            self._watch(now)
        if self.state.leaves_trail:
            now.run.trail.drop_crumb(now.odom)
        step = self.state.tick(now)
        if step.then is not None:
            self._change(now, step.then, step.reason)
        self._note_motion(now, step.wish)
        self._report(now)
        return step.wish

    # ------------------------------------------------------------------ changes

    def _change(self, now: Situation, then: State | Name, reason: str) -> None:
        self.state = STATES[then]() if isinstance(then, str) else then
        self.reason = reason
        self._moving_since = self._denied_ns = None
        self.state.enter(now)
        self._reported_ns = None

    def _carry_out(self, request: Request, now: Situation) -> None:
        """Requests that make no sense in the present state are ignored."""
        state, verb = self.state, request.verb
        if verb == "start" and isinstance(state, Idle | Done | Error):
            self.run = now.run = RunRecord(started_ns=now.t_ns)
            self._set_off(now, "undock" if now.contact.charging else "look", verb)
        elif verb == "pause" and state.active:
            now.desk.drop()
            self._change(now, Paused(state), "pause was requested")
        elif verb == "resume" and isinstance(state, Paused):
            self._set_off(now, state.before, verb)
        elif verb == "stop" and not isinstance(state, Idle):
            now.desk.drop()
            now.orders.append(StopOrder(now.t_ns, "stop was requested"))
            self._change(now, Idle(), "stop was requested")
        elif verb == "dock" and not isinstance(state, Return | Dock) and not now.contact.charging:
            self.run.dock_tries = 0
            self._set_off(now, "return", verb)

    def _set_off(self, now: Situation, then: State | Name, verb: str) -> None:
        reason = f"{verb} was requested"
        self._change(now, Starting(then, reason) if now.latched else then, reason)

    # ------------------------------------------------------------------ the watch

    def _watch(self, now: Situation) -> None:
        """What may happen in any active state."""
        state, config = self.state, now.config
        trouble = self._trouble(now) if state.guarded else None
        if trouble is not None:
            self._change(now, Recover(trouble[0], state.after_trouble), trouble[1])
            return
        blind_s = self._denied_s(now)
        if blind_s > config.denied_give_up_s:
            reason = f"could not move for {blind_s:.0f} s: {now.gate.verdict.denied}"
            self._change(now, Error(reason), reason)
            return
        if isinstance(state, Return | Dock | Undock | Recover | Starting):
            return
        if now.battery_pct <= config.battery_return_pct:
            self._change(now, "return", f"the battery is down to {now.battery_pct:.0f} %")
        elif seconds(self.run.started_ns, now.t_ns) > config.max_duration_s:
            self._change(now, "return", "the time for this run is over")

    def _trouble(self, now: Situation) -> tuple[Kind, str] | None:
        stop = now.link.stop_reason.lower()
        if now.contact.cliff or "cliff" in stop:
            return "cliff", "a cliff sensor sees no floor"
        if now.touching or "bump" in stop:
            side = "left" if now.contact.bump_left else "right"
            both = now.contact.bump_left == now.contact.bump_right
            return "bump", f"the bumper was pressed {'in front' if both else 'on the ' + side}"
        if now.latched and not now.contact.wheel_drop:
            return "stop", f"the motor controller stopped: {now.link.stop_reason}"
        if self._stuck(now):
            return "stuck", f"the robot has not moved for {now.config.stuck_s:.0f} s"
        return None

    def _note_motion(self, now: Situation, wish: Wish) -> None:
        """Since when the robot has been trying to move, and from where."""
        tries = abs(wish.v_mps) > 0.03 or abs(wish.yaw_rate_radps) > 0.15
        here = (now.t_ns, now.driven_m, now.turned_rad)
        since = self._moving_since
        if not tries or not self.state.active or now.gate.verdict.denied:
            self._moving_since = None
        elif since is None or here[1] - since[1] > 0.03 or here[2] - since[2] > 0.2:
            self._moving_since = here

    def _stuck(self, now: Situation) -> bool:
        since = self._moving_since
        return since is not None and seconds(since[0], now.t_ns) > now.config.stuck_s

    def _denied_s(self, now: Situation) -> float:
        """How long the gate has denied every movement."""
        if not now.gate.verdict.denied:
            self._denied_ns = None
            return 0.0
        if self._denied_ns is None:
            self._denied_ns = now.t_ns
        return seconds(self._denied_ns, now.t_ns)

    # ------------------------------------------------------------------ words

    def _report(self, now: Situation) -> None:
        if self._reported_ns is not None and now.t_ns - self._reported_ns < REPORT_NS:
            return
        self._reported_ns = now.t_ns
        remaining_m2 = self.run.remaining_m2 if self.run.plans else math.nan
        now.orders.append(
            MissionState(now.t_ns, self.state.name, self.reason, now.swept.area_m2, remaining_m2)
        )
