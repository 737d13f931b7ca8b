"""Do the wheels carry? What they say is compared with what the eyes see pass by."""

from __future__ import annotations

from collections import deque

from robot.geometry.se2 import SE2
from robot.messages import VisualMotion

FRAMES = 20  # two seconds at 10 Hz
MIN_ROLLED_M = 0.15  # less proves nothing
MIN_SHARE = 0.3  # of the rolled way; less is slipping
MIN_INLIERS = 15
STALE_NS = 1_000_000_000


class SlipWatch:
    """Sums of the forward way over the last frames: of the wheels, and of the eyes."""

    def __init__(self) -> None:
        self._steps: deque[tuple[float, float]] = deque(maxlen=FRAMES)
        self._last: tuple[int, SE2] | None = None

    def see(self, t_ns: int, odom_from_base: SE2, motion: VisualMotion | None) -> None:
        """A frame, with the odometry pose at its time and the motion since the frame before."""
        last, self._last = self._last, (t_ns, odom_from_base)
        if last is None or t_ns - last[0] > STALE_NS:
            self._steps.clear()
            return
        if motion is None or motion.inliers < MIN_INLIERS:
            return
        wheels = last[1].inverse() @ odom_from_base
        sign = 1.0 if wheels.x_m >= 0.0 else -1.0
        self._steps.append((abs(wheels.x_m), sign * motion.previous_from_current.x_m))

    def forget(self) -> None:
        """Begin anew: what comes now has nothing to do with what was."""
        self._steps.clear()

    @property
    def slipping(self) -> bool:
        """Whether the wheels turned in vain."""
        rolled_m = sum(step[0] for step in self._steps)
        seen_m = sum(step[1] for step in self._steps)
        return rolled_m > MIN_ROLLED_M and seen_m < MIN_SHARE * rolled_m
