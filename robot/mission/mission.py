"""The state machine: requests, the watch over every active state, and the changes."""

from __future__ import annotations

import math

from robot.control.wish import Wish
from robot.messages import MissionState, Request
from robot.mission.asks import Asks
from robot.mission.job import Job
from robot.mission.ladder import Kind
from robot.mission.room_book import RoomBook
from robot.mission.state import Name, RunRecord, Situation, State, seconds
from robot.mission.states.charge import Charge
from robot.mission.states.clean import WORK
from robot.mission.states.dock import Dock
from robot.mission.states.lifted import Lifted, Lost
from robot.mission.states.look import Look
from robot.mission.states.recover import Recover
from robot.mission.states.rest import Done, Error, Idle, Starting
from robot.mission.states.travel import Return
from robot.mission.states.undock import Undock
from robot.mission.states.wheel_only import WheelOnly

REPORT_NS = 1_000_000_000
STATES: dict[Name, type[State]] = {
    "undock": Undock,
    "look": Look,
    "return": Return,
    "dock": Dock,
    "done": Done,
    "charge": Charge,
}


class Mission:
    """What the robot is about, and why."""

    def __init__(self, book: RoomBook) -> None:
        self.state: State = Idle()
        self.reason = "switched on"
        self.run = RunRecord()
        self._asks = Asks(book)
        self._reported_ns: int | None = None
        self._moving_since: tuple[int, float, float] | None = None
        self._denied_ns: int | None = None

    @property
    def trusts_place(self) -> bool:
        """Whether what is seen may change the map: not after the robot was carried."""
        return not isinstance(self.state, Lifted)

    def request(self, request: Request) -> None:
        """Take a request in; it is judged at the next tick."""
        self._asks.take(request)

    def tick(self, now: Situation) -> Wish:
        """One beat: the wish for the wheels; other commands are added to `now.orders`."""
        now.run = self.run
        self._asks.carry_out(self, now)
        if self.state.active:
            self._watch(now)
        if self.state.leaves_trail:
            now.run.trail.drop_crumb(now.odom)
        step = self.state.tick(now)
        if step.then is not None:
            self.change(now, step.then, step.reason)
        self._note_motion(now, step.wish)
        self._report(now)
        return step.wish

    # ------------------------------------------------------------------ changes

    def begin(self, now: Situation, job: Job, errand: State | None = None) -> None:
        """A new run: `job`, or an `errand` instead of it."""
        docked = now.contact.charging
        self.run = now.run = RunRecord(job, errand, from_dock=docked, started_ns=now.t_ns)
        if errand is None:
            now.swept.begin_anew()
        first: Name = "undock" if docked else "work" if errand is not None else "look"
        what = job.what if errand is None else errand.name
        self.set_off(now, first, f"{what} was requested")

    def set_off(self, now: Situation, then: State | Name, reason: str) -> None:
        """Change to a state that drives, and clear a stop that is held before."""
        self.change(now, Starting(then, reason) if now.latched else then, reason)

    def change(self, now: Situation, then: State | Name, reason: str) -> None:
        """Go on with another state; the reason is for people."""
        if then == "work":
            then = self.run.errand or WORK[self.run.job.kind]()
        self.state = STATES[then]() if isinstance(then, str) else then
        self.reason = reason
        self._moving_since = self._denied_ns = None
        self.state.enter(now)
        self._reported_ns = None

    # ------------------------------------------------------------------ the watch

    def _watch(self, now: Situation) -> None:
        """What may happen in any active state."""
        state, config = self.state, now.config
        if self._emergency(now):
            return
        trouble = self._trouble(now) if state.guarded else None
        if trouble is not None and not (trouble[0] == "bump" and state.bears(now)):
            self.change(now, Recover(trouble[0], state.after_trouble), trouble[1])
            return
        denied_s = self._denied_s(now)
        if denied_s > config.denied_give_up_s and not isinstance(state, Lifted):
            reason = f"could not move for {denied_s:.0f} s: {now.gate.verdict.denied}"
            self.change(now, Error(reason), reason)
            return
        if isinstance(state, Dock | Undock | Recover | Starting | Lifted | WheelOnly):
            return
        if now.blind_s > config.blind_after_s:
            reason = f"nothing has been seen for {now.blind_s:.0f} s"
            self.change(now, WheelOnly(state.after_trouble), reason)
            return
        if isinstance(state, Return):
            return
        if now.battery_pct <= config.battery_return_pct:
            self.run.charges = self.run.errand is None
            self.change(now, "return", f"the battery is down to {now.battery_pct:.0f} %")
        elif seconds(self.run.started_ns, now.t_ns) > config.max_duration_s:
            self.change(now, "return", "the time for this run is over")

    def _emergency(self, now: Situation) -> bool:
        """Lifted, or at the end of the battery: whatever it is about, it ends here."""
        state = self.state
        if now.contact.wheel_drop and not isinstance(state, Lifted):
            resume: State | Name = state.after_trouble
            if isinstance(state, Undock | Starting | Recover | WheelOnly):
                resume = "look"
            elif isinstance(state, Dock):
                resume = "return"
            self.change(now, Lifted(resume), "it was lifted, or a wheel hangs over an edge")
            return True
        busy = Dock | Undock | Starting | Recover | Lifted | WheelOnly
        if now.health == "lost" and not isinstance(state, busy):
            self.change(now, Lost(state.after_trouble), "it does not know where it is")
            return True
        if now.battery_pct <= now.config.battery_stop_pct and not now.contact.charging:
            reason = f"the battery is down to {now.battery_pct:.0f} %: it stopped; carry it home"
            self.change(now, Error(reason), reason)
            return True
        return False

    def _trouble(self, now: Situation) -> tuple[Kind, str] | None:
        stop = now.link.stop_reason.lower()
        if now.contact.cliff or "cliff" in stop:
            return "cliff", "a cliff sensor sees no floor"
        if now.touching or "bump" in stop:
            side = "left" if now.contact.bump_left else "right"
            both = now.contact.bump_left == now.contact.bump_right
            return "bump", f"the bumper was pressed {'in front' if both else 'on the ' + side}"
        if now.latched:
            return "stop", f"the motor controller stopped: {_in_words(now.link.stop_reason)}"
        if now.slipping:
            return "slip", "the wheels turn, but the floor does not pass"
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
        remaining_m2 = max(0.0, self.run.due_m2 - now.swept.area_m2) if self.run.plans else math.nan
        now.orders.append(
            MissionState(now.t_ns, self.state.name, self.reason, now.swept.area_m2, remaining_m2)
        )


def _in_words(stop_reason: str) -> str:
    """The motor controller's word, for people."""
    return {"stall": "a wheel does not turn (stall)"}.get(stop_reason, stop_reason)
