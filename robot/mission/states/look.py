"""Turning once on the spot, to see the room."""

from __future__ import annotations

import math

from robot.control.wish import Wish
from robot.mission.state import Situation, State, Step, seconds

TURN_RAD = 2.0 * math.pi - 0.6  # the camera sees more than that to both sides
TIMEOUT_S = 40.0


class Look(State):
    """One slow turn, then cleaning begins or goes on."""

    name = "look"

    def enter(self, now: Situation) -> None:
        self._since_ns = now.t_ns
        self._from_rad = now.turned_rad
        now.run.looks += 1

    def tick(self, now: Situation) -> Step:
        turned = now.turned_rad - self._from_rad
        if turned >= TURN_RAD or seconds(self._since_ns, now.t_ns) > TIMEOUT_S:
            return Step(then="work", reason="looked around, making a plan")
        return Step(Wish(0.0, now.config.look_radps, reason="looking around"))
