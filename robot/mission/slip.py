"""Do the wheels carry? What they roll is compared with what the eyes see pass by."""

from __future__ import annotations

import math
from collections import deque

from robot.messages import VisualMotion, WheelTravel

FRAMES = 20  # two seconds at 10 Hz
LATELY = 10  # of them, for what is lost here
MIN_ROLLED_M = 0.15  # less proves nothing
LATELY_ROLLED_M = 0.1
MIN_SHARE = 0.3  # of the rolled way; less is slipping
MIN_INLIERS = 15
STALE_NS = 1_000_000_000


class SlipWatch:
    """Sums over the last frames, mean of both wheels: rolled, and carried as the eyes tell."""

    def __init__(self, track_width_m: float) -> None:
        self._half_m = track_width_m / 2.0
        self._steps: deque[tuple[float, float]] = deque(maxlen=FRAMES)
        self._travel: WheelTravel | None = None
        self._last: tuple[int, WheelTravel] | None = None

    def wheels(self, travel: WheelTravel) -> None:
        """The newest travel of the wheels."""
        self._travel = travel

    def see(self, t_ns: int, motion: VisualMotion | None) -> None:
        """A frame, and the motion since the one before; it is a little older than the wheels."""
        travel = self._travel
        if travel is None:
            return
        last, self._last = self._last, (t_ns, travel)
        if last is None or t_ns - last[0] > STALE_NS:
            self._steps.clear()
            return
        if motion is None or motion.inliers < MIN_INLIERS:
            return
        seen = motion.previous_from_current
        left_m, right_m = travel.left_m - last[1].left_m, travel.right_m - last[1].right_m
        turn_m = self._half_m * seen.yaw_rad
        carried = math.copysign(1.0, left_m) * (seen.x_m - turn_m)
        carried += math.copysign(1.0, right_m) * (seen.x_m + turn_m)
        self._steps.append((0.5 * (abs(left_m) + abs(right_m)), 0.5 * carried))

    def forget(self) -> None:
        """Begin anew: what comes now has nothing to do with what was."""
        self._steps.clear()

    @property
    def lost(self) -> float:
        """Share of the way rolled lately, 0 to 1, that carried nothing; NaN: too little rolled."""
        lately = list(self._steps)[-LATELY:]
        rolled_m, carried_m = (sum(step[i] for step in lately) for i in (0, 1))
        if rolled_m < LATELY_ROLLED_M:
            return math.nan
        return min(1.0, max(0.0, 1.0 - carried_m / rolled_m))

    @property
    def slipping(self) -> bool:
        """Whether the wheels turned in vain."""
        rolled_m = sum(step[0] for step in self._steps)
        carried_m = sum(step[1] for step in self._steps)
        return rolled_m > MIN_ROLLED_M and carried_m < MIN_SHARE * rolled_m
