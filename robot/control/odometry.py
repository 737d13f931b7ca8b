"""Dead reckoning for short memories: smooth, never corrected, good over some seconds.

Distance comes from the wheels. Turning comes from the gyro while it is fresh, with its bias learned
whenever the wheels stand, otherwise from the difference of the wheels over the track width
(Siegwart and Nourbakhsh, Introduction to Autonomous Mobile Robots, section 5.2.4).
"""

from __future__ import annotations

from collections import deque

from robot.config import RobotConfig
from robot.geometry.se2 import SE2, exp, interpolate
from robot.messages import ImuSample, WheelTravel

HISTORY = 100  # two seconds at 50 Hz
GYRO_FRESH_NS = 100_000_000
STILL_TURNS = 3  # encoders are coarse: one silent sample of them proves nothing
STANDING_TURNS = 10  # standing samples before the gyro's bias is trusted
BIAS_GAIN = 0.05
STANDING_M = 1e-4


class DeadReckoning:
    """Pose of `base` in `odom`, a frame that drifts slowly but never jumps."""

    def __init__(self, robot: RobotConfig) -> None:
        self._track_width_m = robot.track_width_m
        self.odom_from_base = SE2()
        self.driven_m = 0.0  # sum of absolute driving
        self.turned_rad = 0.0  # sum of absolute turning
        self._last: WheelTravel | None = None
        self._gyro: ImuSample | None = None
        self._bias_radps = 0.0
        self._standing = STILL_TURNS
        self._history: deque[tuple[int, SE2]] = deque(maxlen=HISTORY)

    @property
    def t_ns(self) -> int | None:
        """Time of the newest wheel travel, None before the first."""
        return None if self._last is None else self._last.t_ns

    def imu(self, sample: ImuSample) -> None:
        """Take a sample of the gyro."""
        if self._standing >= STANDING_TURNS:
            self._bias_radps += BIAS_GAIN * (sample.yaw_rate_radps - self._bias_radps)
        self._gyro = sample

    def wheels(self, travel: WheelTravel) -> None:
        """Advance by the wheels' travel since the last event; older ones are ignored."""
        last, self._last = self._last, travel
        if last is None:
            self._history.append((travel.t_ns, self.odom_from_base))
            return
        if travel.t_ns <= last.t_ns:
            self._last = last
            return
        left_m, right_m = travel.left_m - last.left_m, travel.right_m - last.right_m
        forward_m = 0.5 * (left_m + right_m)
        yaw_rad = (right_m - left_m) / self._track_width_m
        still = abs(left_m) < STANDING_M and abs(right_m) < STANDING_M
        self._standing = self._standing + 1 if still else 0
        standing = self._standing >= STILL_TURNS
        gyro = self._gyro
        if gyro is not None and travel.t_ns - gyro.t_ns < GYRO_FRESH_NS and not standing:
            yaw_rad = (gyro.yaw_rate_radps - self._bias_radps) * (travel.t_ns - last.t_ns) * 1e-9
        if not standing:
            self.odom_from_base = self.odom_from_base @ exp(forward_m, 0.0, yaw_rad)
            self.driven_m += abs(forward_m)
            self.turned_rad += abs(yaw_rad)
        self._history.append((travel.t_ns, self.odom_from_base))

    def at(self, t_ns: int) -> SE2:
        """Pose at a recent time, interpolated; clamped to the two seconds that are kept."""
        history = self._history
        if not history or t_ns >= history[-1][0]:
            return self.odom_from_base
        later = history[-1]
        for earlier in reversed(history):
            if earlier[0] <= t_ns:
                span_ns = later[0] - earlier[0]
                if span_ns <= 0:
                    return earlier[1]
                return interpolate(earlier[1], later[1], (t_ns - earlier[0]) / span_ns)
            later = earlier
        return history[0][1]
