"""On the dock with work left: charge, then go on."""

from __future__ import annotations

import math

from robot.control.wish import halt
from robot.mission.state import Situation, State, Step, seconds
from robot.mission.states.rest import give_up

TAKEN_S = 3.0  # the contact may chatter


class Charge(State):
    """Waits for `battery_resume_pct`; the run's own time stands still meanwhile."""

    name = "charge"
    active = guarded = False

    def enter(self, now: Situation) -> None:
        self._charging_ns = self._counted_ns = now.t_ns

    def tick(self, now: Situation) -> Step:
        now.run.started_ns += now.t_ns - self._counted_ns
        self._counted_ns = now.t_ns
        if now.contact.charging:
            self._charging_ns = now.t_ns
        elif seconds(self._charging_ns, now.t_ns) > TAKEN_S:
            return give_up("it was taken off its dock while charging; put it back")
        full = now.battery_pct >= now.config.battery_resume_pct
        if full and not math.isnan(now.battery_pct) and now.contact.charging:
            now.run.charges, now.run.dock_tries = False, 0
            reason = f"charged to {now.battery_pct:.0f} %, going on with {now.run.job.what}"
            return Step(then="undock", reason=reason)
        return Step(halt(f"charging, then it goes on with {now.run.job.what}"))
