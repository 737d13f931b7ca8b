"""Driving by hand. A dead man's handle: what is not asked again, ends."""

from __future__ import annotations

from robot.control.wish import Wish, halt
from robot.mission.state import Latch, Situation, State, Step, seconds
from robot.mission.states.rest import Idle

LEFT_ALONE_S = 30.0  # then it is over


class Manual(State):
    """The wish is the newest order by hand, for `control.manual_expires_s`; the gate judges it."""

    name = "manual"
    active = guarded = False

    def __init__(self) -> None:
        self._latch = Latch()
        self._wish, self._asked_ns = Wish(), 0

    def order(self, t_ns: int, v_mps: float, yaw_rate_radps: float) -> None:
        """Drive so from now on, for a moment."""
        self._wish = Wish(v_mps, yaw_rate_radps, reason="driving by hand")
        self._asked_ns = t_ns

    def enter(self, now: Situation) -> None:
        now.desk.drop()

    def tick(self, now: Situation) -> Step:
        age_s = seconds(self._asked_ns, now.t_ns)
        if age_s > LEFT_ALONE_S:
            return Step(then=Idle(), reason="nobody drives by hand any more")
        if age_s > now.control.manual_expires_s:
            return Step(halt("waiting for the next order by hand"))
        if not self._latch.clear(now, "driving by hand"):
            return Step(halt("waiting for the motor controller"))
        return Step(self._wish)
