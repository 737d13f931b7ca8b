"""Rigid motions of the plane.

`world_from_base @ base_from_cam` gives `world_from_cam`: names chain when neighbours cancel.
Frames follow REP-103: x forward, y left, yaw counter-clockwise.
Formulas for exp and log: Eade, "Lie Groups for 2D and 3D Transformations" (2017), section 3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

_SMALL_RAD = 1e-6


def wrap_angle(angle_rad: float) -> float:
    """Return the same direction in [-pi, pi)."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


@dataclass(frozen=True, slots=True)
class SE2:
    """A pose or motion in the plane: translation in metres, yaw in radians."""

    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0

    def __matmul__(self, other: SE2) -> SE2:
        """Compose: `a_from_b @ b_from_c` is `a_from_c`; yaw is wrapped."""
        c, s = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return SE2(
            self.x_m + c * other.x_m - s * other.y_m,
            self.y_m + s * other.x_m + c * other.y_m,
            wrap_angle(self.yaw_rad + other.yaw_rad),
        )

    def inverse(self) -> SE2:
        """`a_from_b.inverse()` is `b_from_a`."""
        c, s = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return SE2(
            -c * self.x_m - s * self.y_m, s * self.x_m - c * self.y_m, wrap_angle(-self.yaw_rad)
        )

    def apply(self, points_m: np.ndarray) -> np.ndarray:
        """Map points of shape (..., 2), in metres, from the right frame into the left one."""
        c, s = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        x, y = points_m[..., 0], points_m[..., 1]
        return np.stack([self.x_m + c * x - s * y, self.y_m + s * x + c * y], axis=-1)

    def log(self) -> tuple[float, float, float]:
        """Twist (x_m, y_m, yaw_rad) whose exponential is this motion."""
        half = 0.5 * self.yaw_rad
        a = 1.0 - half * half / 3.0 if abs(half) < _SMALL_RAD else half / math.tan(half)
        return a * self.x_m + half * self.y_m, -half * self.x_m + a * self.y_m, self.yaw_rad

    def distance_m(self, other: SE2) -> float:
        """Euclidean distance between the two origins."""
        return math.hypot(self.x_m - other.x_m, self.y_m - other.y_m)


def exp(x_m: float, y_m: float, yaw_rad: float) -> SE2:
    """Motion along a circular arc: the twist applied for one unit of time."""
    if abs(yaw_rad) < _SMALL_RAD:
        a, b = 1.0 - yaw_rad * yaw_rad / 6.0, 0.5 * yaw_rad
    else:
        a, b = math.sin(yaw_rad) / yaw_rad, (1.0 - math.cos(yaw_rad)) / yaw_rad
    return SE2(a * x_m - b * y_m, b * x_m + a * y_m, wrap_angle(yaw_rad))


def interpolate(start: SE2, end: SE2, fraction: float) -> SE2:
    """Pose on the arc from `start` (fraction 0) to `end` (fraction 1)."""
    x_m, y_m, yaw_rad = (start.inverse() @ end).log()
    return start @ exp(fraction * x_m, fraction * y_m, fraction * yaw_rad)
