"""What was rolled and turned, and where the robot was: short memories that can be asked by time."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from robot.geometry.se2 import SE2, interpolate
from robot.slam.motion import Steps

_KEEP_NS = 10_000_000_000
_EXTRAPOLATE_NS = 100_000_000  # the last speed is believed for this long
_MAX_GAP_NS = 150_000_000  # a longer silence means that the sensor is not there
_MAX_SPEED = 5.0  # m/s or rad/s: beyond, the counter was reset rather than moved


class Series:
    """A cumulative quantity sampled in time; between samples it is linear."""

    def __init__(self) -> None:
        self.t_ns: list[int] = []
        self.value: list[float] = []

    def append(self, t_ns: int, value: float) -> None:
        """Add a sample; one that is not newer than the last is ignored."""
        if self.t_ns and t_ns <= self.t_ns[-1]:
            return
        self.t_ns.append(t_ns)
        self.value.append(value)
        if self.t_ns[0] < t_ns - 2 * _KEEP_NS:
            keep = bisect_left(self.t_ns, t_ns - _KEEP_NS)
            del self.t_ns[:keep], self.value[:keep]

    def at(self, t_ns: int) -> float:
        """Value at `t_ns`: the first before the start, extrapolated shortly after the end."""
        times, value = self.t_ns, self.value
        i = bisect_right(times, t_ns)
        if i == 0:
            return value[0]
        if i < len(times):
            span = times[i] - times[i - 1]
            return value[i - 1] + (value[i] - value[i - 1]) * ((t_ns - times[i - 1]) / span)
        if len(times) < 2 or times[-1] - times[-2] > _MAX_GAP_NS:
            return value[-1]
        ahead = min(t_ns - times[-1], _EXTRAPOLATE_NS) / (times[-1] - times[-2])
        return value[-1] + (value[-1] - value[-2]) * ahead

    def covers(self, start_ns: int, end_ns: int) -> bool:
        """Whether samples surround the interval without a long silence."""
        times = self.t_ns
        if not times or times[0] > start_ns + _MAX_GAP_NS or times[-1] < end_ns - _MAX_GAP_NS:
            return False
        i, j = bisect_right(times, start_ns), bisect_left(times, end_ns)
        inside = times[max(i - 1, 0) : j + 1]
        return all(b - a <= _MAX_GAP_NS for a, b in pairwise(inside))


@dataclass(frozen=True, slots=True)
class Mark:
    """Readings of the cumulative counters up to which motion has been used; NaN: none yet."""

    t_ns: int
    left_m: float
    right_m: float
    yaw_rad: float


class OdometryBuffer:
    """The last seconds of wheel travel and gyro turn."""

    def __init__(self) -> None:
        self._left, self._right, self._yaw = Series(), Series(), Series()
        self._offset = (0.0, 0.0)  # added after a reset of the counters

    def add_wheels(self, t_ns: int, left_m: float, right_m: float) -> None:
        """Add cumulative wheel travel; a jump no wheel can make restarts the count."""
        left, right = left_m + self._offset[0], right_m + self._offset[1]
        if self._left.t_ns and t_ns > self._left.t_ns[-1]:
            reach = _MAX_SPEED * max((t_ns - self._left.t_ns[-1]) * 1e-9, 0.02)
            jump_left, jump_right = left - self._left.value[-1], right - self._right.value[-1]
            if max(abs(jump_left), abs(jump_right)) > reach:
                self._offset = (self._offset[0] - jump_left, self._offset[1] - jump_right)
                left, right = left - jump_left, right - jump_right
        self._left.append(t_ns, left)
        self._right.append(t_ns, right)

    def add_gyro(self, t_ns: int, yaw_rate_radps: float) -> None:
        """Add a turn rate: the mean since the last sample, as a gyro's low-pass filter gives it."""
        if not self._yaw.t_ns:
            self._yaw.append(t_ns, 0.0)
        elif t_ns > self._yaw.t_ns[-1]:
            gap = t_ns - self._yaw.t_ns[-1]
            mean_radps = yaw_rate_radps if gap <= _MAX_GAP_NS else 0.0
            self._yaw.append(t_ns, self._yaw.value[-1] + mean_radps * gap * 1e-9)

    def mark(self, t_ns: int) -> Mark:
        """The counters at `t_ns`."""
        left, right, yaw = (
            series.at(t_ns) if series.t_ns else math.nan
            for series in (self._left, self._right, self._yaw)
        )
        return Mark(t_ns, left, right, yaw)

    def has_wheels(self, start_ns: int, end_ns: int) -> bool:
        """Whether wheel travel is known over the interval."""
        return self._left.covers(start_ns, end_ns)

    def gyro_yaw_rad(self, start: Mark, end_ns: int) -> float | None:
        """Turn since `start`, bias not removed; None without a gyro."""
        if not self._yaw.covers(start.t_ns, end_ns):
            return None
        begin = self._yaw.at(start.t_ns) if math.isnan(start.yaw_rad) else start.yaw_rad
        return self._yaw.at(end_ns) - begin

    def steps(self, start: Mark, end_ns: int) -> Steps:
        """The interval since `start`, cut at every wheel sample."""
        times = self._left.t_ns
        cuts = times[bisect_right(times, start.t_ns) : bisect_left(times, end_ns)]
        if math.isnan(start.left_m):
            begin = self.mark(start.t_ns)
            start = replace(start, left_m=begin.left_m, right_m=begin.right_m)
        if math.isnan(start.yaw_rad):
            start = replace(start, yaw_rad=self.mark(start.t_ns).yaw_rad)
        marks = [start, *(self.mark(t_ns) for t_ns in cuts), self.mark(end_ns)]
        table = np.array([(m.t_ns - start.t_ns, m.left_m, m.right_m, m.yaw_rad) for m in marks])
        change = np.diff(table, axis=0)
        has_gyro = self._yaw.covers(start.t_ns, end_ns)
        return Steps(
            change[:, 0] * 1e-9, change[:, 1], change[:, 2], change[:, 3] if has_gyro else None
        )


class PoseHistory:
    """Poses at the times of past frames, with covariances (3, 3)."""

    def __init__(self) -> None:
        self._t_ns: list[int] = []
        self._pose: list[tuple[SE2, np.ndarray]] = []

    def append(self, t_ns: int, pose: SE2, cov: np.ndarray) -> None:
        """Remember a pose; times must increase."""
        self._t_ns.append(t_ns)
        self._pose.append((pose, cov))
        if self._t_ns[0] < t_ns - 2 * _KEEP_NS:
            keep = bisect_left(self._t_ns, t_ns - _KEEP_NS)
            del self._t_ns[:keep], self._pose[:keep]

    def clear(self) -> None:
        """Forget all: the poses before were wrong."""
        self._t_ns.clear()
        self._pose.clear()

    def at(self, t_ns: int) -> tuple[SE2, np.ndarray]:
        """Pose and covariance at `t_ns`, interpolated; the nearest end outside the memory."""
        i = bisect_right(self._t_ns, t_ns)
        if i == 0 or i == len(self._t_ns):
            return self._pose[max(i - 1, 0)]
        (start, start_cov), (end, end_cov) = self._pose[i - 1], self._pose[i]
        part = (t_ns - self._t_ns[i - 1]) / (self._t_ns[i] - self._t_ns[i - 1])
        return interpolate(start, end, part), (1.0 - part) * start_cov + part * end_cov
