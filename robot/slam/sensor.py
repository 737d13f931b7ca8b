"""What a landmark looks like from a pose: h, its inverse, and the Jacobians of both.

A point is seen as (1 / range_m, bearing_rad) in `base`: stereo errs in disparity, so the inverse
range, not the range, has the same Gaussian error wherever the point stands; with the range itself
far points are drawn near and the map shrinks. The dock's marker is seen as (x_m, y_m, yaw_rad).
Range-bearing model: Thrun, Burgard, Fox, "Probabilistic Robotics" (2005), section 6.6; inverse
depth: Montiel, Civera, Davison, "Unified Inverse Depth Parametrization" (RSS 2006).
"""

from __future__ import annotations

import numpy as np

_NEAR_M = 1e-6


def sights_of(polar: np.ndarray, cov: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sights (m, 2) and their covariances (m, 2, 2) from (range_m, bearing_rad) and theirs."""
    slope = np.ones_like(polar)
    slope[:, 0] = -1.0 / polar[:, 0] ** 2
    sights = np.stack([1.0 / polar[:, 0], polar[:, 1]], axis=1)
    return sights, slope[:, :, None] * cov * slope[:, None, :]


def wrap(angle_rad: np.ndarray) -> np.ndarray:
    """The same directions in [-pi, pi)."""
    return (angle_rad + np.pi) % (2.0 * np.pi) - np.pi


def expected(pose: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """h: sights (m, 2) of `points` (m, 2) in `world` from `pose` (3,), and its Jacobians.

    The Jacobians are by the pose (m, 2, 3) and by the point (m, 2, 2).
    """
    dx, dy = points[:, 0] - pose[0], points[:, 1] - pose[1]
    r = np.maximum(np.hypot(dx, dy), _NEAR_M)
    sights = np.stack([1.0 / r, wrap(np.arctan2(dy, dx) - pose[2])], axis=1)
    by_point = np.empty((len(points), 2, 2))
    by_point[:, 0, 0], by_point[:, 0, 1] = -dx / r**3, -dy / r**3
    by_point[:, 1, 0], by_point[:, 1, 1] = -dy / r**2, dx / r**2
    by_pose = np.empty((len(points), 2, 3))
    by_pose[:, :, :2] = -by_point
    by_pose[:, 0, 2], by_pose[:, 1, 2] = 0.0, -1.0
    return sights, by_pose, by_point


def headings(pose: np.ndarray, sights: np.ndarray) -> np.ndarray:
    """Unit vectors (m, 2) in `world` along which the `sights` (m, 2) are seen from `pose` (3,)."""
    angle = pose[2] + sights[:, 1]
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def locate(pose: np.ndarray, sights: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Inverse of h: points (m, 2) in `world`, with Jacobians by pose (m, 2, 3) and sight."""
    angle = pose[2] + sights[:, 1]
    c, s, r = np.cos(angle), np.sin(angle), 1.0 / sights[:, 0]
    points = np.stack([pose[0] + r * c, pose[1] + r * s], axis=1)
    by_pose = np.zeros((len(sights), 2, 3))
    by_pose[:, 0, 0] = by_pose[:, 1, 1] = 1.0
    by_pose[:, 0, 2], by_pose[:, 1, 2] = -r * s, r * c
    by_sight = np.empty((len(sights), 2, 2))
    by_sight[:, 0, 0], by_sight[:, 0, 1] = -c * r * r, -r * s
    by_sight[:, 1, 0], by_sight[:, 1, 1] = -s * r * r, r * c
    return points, by_pose, by_sight


def residual(seen: np.ndarray, predicted: np.ndarray) -> np.ndarray:
    """Difference of sights (m, 2), or of (m, 3) with an angle last; the angle is wrapped."""
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
