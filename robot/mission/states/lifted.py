"""Lifted and put down, perhaps elsewhere, or lost in another way: is the place known?"""

from __future__ import annotations

import math

from robot.control.wish import Wish, halt
from robot.mission.drive import back_round
from robot.mission.state import Latch, Name, Situation, State, Step, seconds
from robot.mission.states.rest import give_up

HELD_S = 120.0  # in the air; then it is no longer waited for
SETTLE_S = 0.6
SETTLE_RAD = 5.8  # some views alone may look like others
TURN_RADPS = 0.6
TURNS_RAD = 4.0 * math.pi
TIMEOUT_S = 30.0
SURE, ENOUGH = 0.75, 0.5  # share of what is seen that the map knows: at once, after half a turn


class Lifted(State):
    """The map is neither believed nor changed until the place is recognised."""

    name = "lifted"
    guarded = False
    happened = "it was put down"
    settled_share = 0.7  # of all that was seen round about: it was put back

    def __init__(self, resume: State | Name) -> None:
        self._resume = resume

    def enter(self, now: Situation) -> None:
        now.desk.drop()
        self._latch, self._way = Latch(), 1.0
        self._held_ns = self._since_ns = now.t_ns
        self._down_ns: int | None = None
        self._from_rad = now.turned_rad

    def tick(self, now: Situation) -> Step:
        if now.contact.wheel_drop:
            self._down_ns = None
            if seconds(self._since_ns, now.t_ns) > HELD_S:
                return give_up("its wheels hang in the air; put it on the floor and start it")
            return Step(halt("its wheels hang in the air"))
        if self._down_ns is None:
            self._down_ns, self._from_rad = now.t_ns, now.turned_rad
        down_s = seconds(self._down_ns, now.t_ns)
        if down_s < SETTLE_S or not self._latch.clear(now, self.happened):
            if down_s > TIMEOUT_S:
                return give_up(f"the motor controller keeps its stop: {now.link.stop_reason}")
            return Step(halt(self.happened))
        return self._look(now, down_s)

    def _look(self, now: Situation, down_s: float) -> Step:
        turned = now.turned_rad - self._from_rad
        share = 0.0 if math.isnan(now.recognised) else now.recognised
        same = share >= SURE and now.recognised_round >= self.settled_share
        if same and turned >= SETTLE_RAD and now.health == "lost":
            now.settle()  # what it sees stands where it was: nobody carried it away
            return Step(then=self._resume, reason=f"{self.happened} where it was")
        enough = SURE if turned < math.pi else ENOUGH
        if share >= enough and now.health != "lost":
            return Step(then=self._resume, reason=f"{self.happened} at a place that it knows")
        if turned > TURNS_RAD or down_s > TIMEOUT_S:
            return give_up(
                f"{self.happened} at a place that it does not recognise; carry it to its dock"
            )
        looking = f"{self.happened}, looking where"
        if now.touching:
            self._way = -1.0 if now.contact.bump_left else 1.0
            return Step(back_round(now.robot, self._way, looking))
        return Step(Wish(0.0, self._way * TURN_RADPS, reason=looking))


class Lost(Lifted):
    """What is seen speaks against the place where the robot believed to be."""

    name = "lost"
    happened = "it found itself"
    settled_share = 0.45  # nobody felt that it was carried, and a map has gaps
