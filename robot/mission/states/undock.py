"""Leaving the dock, backwards: it learns the dock's shape on the way, then looks around."""

from __future__ import annotations

import numpy as np

from robot.config import RobotConfig
from robot.control.wish import Wish, halt
from robot.geometry.se2 import SE2
from robot.mission.state import Latch, Situation, State, Step, seconds
from robot.mission.states.rest import give_up

TIMEOUT_S = 20.0
DOCK_DEPTH_M = 0.10  # so much of its sides is marked; the wall behind it is seen
MARK_EVERY_M = 0.02
KNOWN_M2 = 4.0  # so much free floor is not seen on the way out of a dock


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
            # Its plate is too low and too dark to be seen well, but where it is was never so sure.
            now.grid.mark_obstacle(now.pose.apply(_dock_outline(now.robot)))

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
            if now.run.errand is not None:
                return Step(then="work", reason="out of the dock")
            if now.known_free_m2 >= KNOWN_M2:
                return Step(then="work", reason="out of the dock, and the home is known")
            return Step(then="look", reason="out of the dock, looking around")
        return Step(Wish(-now.control.back_mps, 0.0, reason="backing out of the dock"))


def _dock_outline(robot: RobotConfig) -> np.ndarray:
    """Points (n, 2) of `base` along the front and the sides of the dock before the robot."""
    half_m, front_m = robot.dock_width_m / 2.0, robot.radius_m + MARK_EVERY_M / 2.0
    y = np.arange(-half_m, half_m + 1e-9, MARK_EVERY_M)
    x = np.arange(front_m, front_m + DOCK_DEPTH_M, MARK_EVERY_M)
    front = np.stack([np.full_like(y, front_m), y], axis=-1)
    sides = [np.stack([x, np.full_like(x, side)], axis=-1) for side in (-half_m, half_m)]
    return np.vstack([front, *sides])
