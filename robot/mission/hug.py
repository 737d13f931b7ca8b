"""Along walls, as near as the bumper says.

The map and the eyes know a wall to some centimetres, the bumper to a millimetre. So a robot that
sweeps along something comes slowly nearer to it. Where its side touches it swings free, keeps a
hair off the line on which it touched, and goes on: no trouble, no new plan. It never comes nearer
to what only the map knows: there may be no wall but stairs.
"""

from __future__ import annotations

import math
from dataclasses import replace

from robot.control.follow import turn_rate_radps
from robot.control.limits import clamp
from robot.control.wish import Wish, halt
from robot.geometry.se2 import SE2, wrap_angle
from robot.mission.drive import back_round, slowed
from robot.mission.state import Latch, Situation, seconds
from robot.mission.touch import touch, wall_since

SEEN_ROOM_M = 0.012  # kept to what is only seen, at first
NEARER, NEARER_FELT = 0.1, 0.02  # metres nearer a metre, before and after it was touched
FELT_ROOM_M, MORE = 0.008, 2.0  # kept to what was touched, at first; more where it is touched soon
SOON_M = 0.15
CAREFUL_M, CAREFUL_MPS = 0.3, 0.12  # after that it is slow for so far: it sees things wrongly there
ASIDE_M = 0.06  # farther from its path it does not go
EVERY_S, GAIN = 0.1, 0.4  # what is seen counts so often, so much of the way there
LEFT_M = 0.3  # with nothing beside for so long, what was felt is past
CORNER_RAD = 0.6  # and after such a turn
AGAIN_M = 0.03  # touched again before so much was driven: that is no wall along the way
ALONG_RAD = 1.0  # a wall at a smaller bearing does not run along the way, but across it
SWING_RAD, SWUNG_S = 0.3, 2.0
FACING_RAD = 0.08


class Hug:
    """`aside_m` is how far left of its path the robot is to drive."""

    def __init__(self) -> None:
        self.aside_m = 0.0
        self._side = 0.0  # of what is beside: left 1, right -1, neither or both 0
        self._felt: tuple[float, float] | None = None  # where aside, with which yaw
        self._nearer_m = 0.0  # come so much nearer since it was met or felt
        self._felt_at_m, self._room_m = -math.inf, FELT_ROOM_M
        self._beside_at_m = 0.0
        self._driven_m = math.inf  # when it looked last
        self._looked_ns = 0
        self._swing: _Swing | None = None

    # ------------------------------------------------------------------ beside it

    def look(self, now: Situation, lateral_m: float) -> None:
        """Decide anew; `lateral_m` is how far left of its path the robot is."""
        if seconds(self._looked_ns, now.t_ns) < EVERY_S:
            return
        self._looked_ns = now.t_ns
        driven_m, self._driven_m = max(0.0, now.driven_m - self._driven_m), now.driven_m
        left_m, right_m = now.gate.sight.rooms_beside_m(now.odom)
        side = float(math.isnan(right_m)) - float(math.isnan(left_m))
        if side != 0.0:
            self._beside_at_m = now.driven_m
        self._forget(now, side)
        if self._felt is not None:
            self._nearer_m += NEARER_FELT * driven_m
            self.aside_m = clamp(self._felt[0] + self._side * self._nearer_m, ASIDE_M)
            return
        self._nearer_m = self._nearer_m + NEARER * driven_m if side == self._side else 0.0
        self._side = side
        to_left_m = -lateral_m
        if side != 0.0:
            room_m = left_m if side > 0.0 else right_m
            to_left_m = side * (room_m - SEEN_ROOM_M + self._nearer_m)
        elif not math.isnan(left_m):
            to_left_m = (left_m - right_m) / 2.0
        self.aside_m += GAIN * (clamp(lateral_m + to_left_m, ASIDE_M) - self.aside_m)

    def _forget(self, now: Situation, side: float) -> None:
        """What was felt counts as long as the robot drives along it."""
        if self._felt is None:
            return
        turned = abs(wrap_angle(now.pose.yaw_rad - self._felt[1])) > CORNER_RAD
        if turned or side == -self._side or now.driven_m - self._beside_at_m > LEFT_M:
            self._felt, self._nearer_m = None, 0.0

    def careful(self, now: Situation, wish: Wish) -> Wish:
        """The same way, slower where it was touched twice on little way."""
        soon = self._room_m > FELT_ROOM_M and now.driven_m - self._felt_at_m < CAREFUL_M
        if not soon or wish.v_mps <= CAREFUL_MPS:
            return wish
        v_mps, yaw_rate_radps = slowed(wish.v_mps, wish.yaw_rate_radps, CAREFUL_MPS)
        return replace(wish, v_mps=v_mps, yaw_rate_radps=yaw_rate_radps)

    # ------------------------------------------------------------------ touching it

    @property
    def swinging(self) -> bool:
        """Whether it is just getting free of what it touched."""
        return self._swing is not None

    def feels(self, now: Situation, lateral_m: float) -> bool:
        """Whether a touch now is one of what it drives along, and nothing worse."""
        if self._swing is not None:
            return not self._swing.failed
        side = float(now.contact.bump_left) - float(now.contact.bump_right)
        left_m, right_m = now.gate.sight.rooms_beside_m(now.odom, mapped=True)
        since_m = now.driven_m - self._felt_at_m
        if side == 0.0 or math.isnan(left_m if side > 0.0 else right_m) or since_m < AGAIN_M:
            return False
        self._room_m = MORE * self._room_m if since_m < SOON_M else FELT_ROOM_M
        felt_m = lateral_m - side * self._room_m
        last = touch(now.contact, now.odom)
        wall = wall_since(last, now.run.touches)
        across = wall is not None and abs(wall[1]) < ALONG_RAD
        if abs(felt_m) > ASIDE_M or across:
            return False
        now.run.touches.appendleft(last)
        self._side, self._felt, self._nearer_m = side, (felt_m, now.pose.yaw_rad), 0.0
        self._swing = _Swing(now, side)
        return True

    def swing(self, now: Situation) -> Wish:
        """Getting free."""
        assert self._swing is not None
        wish = self._swing.tick(now)
        if self._swing.over:
            self._swing = None
            self._felt_at_m = self._driven_m = self._beside_at_m = now.driven_m
        return wish


class _Swing:
    """The wheel on the far side backs, so that the robot swings off; then it turns back."""

    def __init__(self, now: Situation, side: float) -> None:
        self._side, self._since_ns = side, now.t_ns
        self._from: SE2 = now.odom
        self._latch = Latch()
        self._off = self.over = self.failed = False

    def tick(self, now: Situation) -> Wish:
        self.failed = seconds(self._since_ns, now.t_ns) > SWUNG_S
        if not self._latch.clear(now, "it touched what it drives along"):
            return halt("waiting for the motor controller")
        turned_rad = wrap_angle(now.odom.yaw_rad - self._from.yaw_rad)
        if not self._off:
            self._off = abs(turned_rad) > SWING_RAD and not now.touching
            return back_round(now.robot, self._side, "swinging off what it touched")
        self.over = abs(turned_rad) < FACING_RAD
        return Wish(0.0, turn_rate_radps(-turned_rad, now.robot), reason="facing its way again")
