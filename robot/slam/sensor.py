"""What a landmark looks like from a pose: h, its inverse, and the Jacobians of both.

A point is seen as (range_m, bearing_rad) in `base`, the dock's marker as (x_m, y_m, yaw_rad).
Range-bearing model: Thrun, Burgard, Fox, "Probabilistic Robotics" (2005), section 6.6.
"""

from __future__ import annotations

import numpy as np

_NEAR_M = 1e-6


def wrap(angle_rad: np.ndarray) -> np.ndarray:
    """The same directions in [-pi, pi)."""
    return (angle_rad + np.pi) % (2.0 * np.pi) - np.pi


def expected(pose: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """h: polar (m, 2) of `points` (m, 2) in `world` from `pose` (3,), and its Jacobians.

    The Jacobians are by the pose (m, 2, 3) and by the point (m, 2, 2).
    """
    dx, dy = points[:, 0] - pose[0], points[:, 1] - pose[1]
    r = np.maximum(np.hypot(dx, dy), _NEAR_M)
    polar = np.stack([r, wrap(np.arctan2(dy, dx) - pose[2])], axis=1)
    by_point = np.empty((len(points), 2, 2))
    by_point[:, 0, 0], by_point[:, 0, 1] = dx / r, dy / r
    by_point[:, 1, 0], by_point[:, 1, 1] = -dy / r**2, dx / r**2
    by_pose = np.empty((len(points), 2, 3))
    by_pose[:, :, :2] = -by_point
    by_pose[:, 0, 2], by_pose[:, 1, 2] = 0.0, -1.0
    return polar, by_pose, by_point


def locate(pose: np.ndarray, polar: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Inverse of h: points (m, 2) in `world`, with Jacobians by pose (m, 2, 3) and polar."""
    angle = pose[2] + polar[:, 1]
    c, s, r = np.cos(angle), np.sin(angle), polar[:, 0]
    points = np.stack([pose[0] + r * c, pose[1] + r * s], axis=1)
    by_pose = np.zeros((len(polar), 2, 3))
    by_pose[:, 0, 0] = by_pose[:, 1, 1] = 1.0
    by_pose[:, 0, 2], by_pose[:, 1, 2] = -r * s, r * c
    by_polar = np.empty((len(polar), 2, 2))
    by_polar[:, 0, 0], by_polar[:, 0, 1] = c, -r * s
    by_polar[:, 1, 0], by_polar[:, 1, 1] = s, r * c
    return points, by_pose, by_polar


def residual(seen: np.ndarray, predicted: np.ndarray) -> np.ndarray:
    """Difference of polars (m, 2), or of (m, 3) with an angle last; the angle is wrapped."""
    change = seen - predicted
    change[:, -1] = wrap(change[:, -1])
    return change


def expected_marker(pose: np.ndarray, marker: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """`base_from_marker` (3,) of a marker (3,) in `world`; Jacobian (3, 6) by pose and marker."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    dx, dy = marker[0] - pose[0], marker[1] - pose[1]
    x, y = c * dx + s * dy, -s * dx + c * dy
    seen = np.array([x, y, wrap(marker[2] - pose[2])])
    jacobian = np.array(
        [
            [-c, -s, y, c, s, 0.0],
            [s, -c, -x, -s, c, 0.0],
            [0.0, 0.0, -1.0, 0.0, 0.0, 1.0],
        ]
    )
    return seen, jacobian


def locate_marker(pose: np.ndarray, seen: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Marker (3,) in `world` seen as `base_from_marker` (3,); Jacobians (3, 3) by both."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    dx, dy = c * seen[0] - s * seen[1], s * seen[0] + c * seen[1]
    marker = np.array([pose[0] + dx, pose[1] + dy, wrap(pose[2] + seen[2])])
    by_pose = np.array([[1.0, 0.0, -dy], [0.0, 1.0, dx], [0.0, 0.0, 1.0]])
    by_seen = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return marker, by_pose, by_seen
