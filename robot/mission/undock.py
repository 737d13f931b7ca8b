"""Leaving the dock, backwards: it learns the dock's shape on the way, then looks around."""

from __future__ import annotations

from robot.control.wish import Wish, halt
from robot.geometry.se2 import SE2
from robot.mission.rest import give_up
from robot.mission.state import Latch, Situation, State, Step, seconds

TIMEOUT_S = 20.0


class Undock(State):
    """Back `undock_m` straight out of the dock."""

    name = "undock"
    leaves_trail = True
    guarded = False  # the bumper may lean on the dock

    def __init__(self) -> None:
        self._latch = Latch()
        self._docked: SE2 | None = None

    def enter(self, now: Situation) -> None:
        self._since_ns = now.t_ns
        if self._docked is None:  # a pause on the way changes nothing
            self._docked = now.odom
            now.sight.world_from_docked = now.pose

    def tick(self, now: Situation) -> Step:
        if seconds(self._since_ns, now.t_ns) > TIMEOUT_S:
            return give_up("the robot could not leave its dock; see what holds it")
        if not self._latch.clear(now, "leaving the dock"):
            return Step(halt("waiting for the motor controller"))
        if now.contact.cliff:
            return give_up("there is a cliff right before the dock; move the dock")
        docked = self._docked or now.odom
        if docked.distance_m(now.odom) >= now.config.undock_m:
            now.sight.learn(now.t_ns, docked)
            return Step(then="look", reason="out of the dock, looking around")
        return Step(Wish(-now.control.back_mps, 0.0, reason="backing out of the dock"))
