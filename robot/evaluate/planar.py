"""Whether a motion in space is a drive in a plane, and the track in that plane."""

from __future__ import annotations

import numpy as np

MIN_PATH_M = 1.0  # less is standing still
MAX_HEIGHT_SHARE = 0.02  # RMS height above the plane, of the length of the path ...
MIN_HEIGHT_M = 0.02  # ... or this much, whichever is more
MAX_TILT_RAD = 0.052  # RMS angle between the base's z axis and the plane's normal: 3 degrees
MAX_SLOPE = 0.27  # of the plane against the first pose: 15 degrees


def planar_track(t_s: np.ndarray, world_from_base: np.ndarray) -> np.ndarray | None:
    """The track (n, 4) of t_s, x_m, y_m, yaw_rad of poses (n, 4, 4) that move in a plane.

    The plane is fitted to the positions, seen from the first pose (x forward, z up), and must lie
    roughly level there. None if the motion is shorter than a metre, rises and falls, or tilts:
    then a planar robot's estimate cannot be judged by it.
    """
    if len(world_from_base) < 3:
        return None
    poses = np.linalg.inv(world_from_base[0]) @ world_from_base
    points = poses[:, :3, 3]
    path_m = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    slope_x, slope_y, height_m = _fit_plane(points)
    normal = np.array([-slope_x, -slope_y, 1.0])
    normal /= np.linalg.norm(normal)
    tilt = np.arccos(np.clip(poses[:, :3, 2] @ normal, -1.0, 1.0))
    planar = (
        path_m >= MIN_PATH_M
        and np.hypot(slope_x, slope_y) <= MAX_SLOPE
        and _rms(height_m) <= max(MIN_HEIGHT_M, MAX_HEIGHT_SHARE * path_m)
        and _rms(tilt) <= MAX_TILT_RAD
    )
    if not planar:
        return None
    to_plane = _plane_axes(normal)
    x, y = (points @ to_plane[:2].T).T
    forward = poses[:, :3, 0] @ to_plane[:2].T
    return np.column_stack([t_s, x, y, np.arctan2(forward[:, 1], forward[:, 0])])


def _fit_plane(points: np.ndarray) -> tuple[float, float, np.ndarray]:
    """Slopes of z over x and y, and the residual heights (n,).

    The least-norm solution: a straight drive says nothing of the slope across it.
    """
    centred = points - points.mean(axis=0)
    slopes, *_ = np.linalg.lstsq(centred[:, :2], centred[:, 2], rcond=1e-2)
    return float(slopes[0]), float(slopes[1]), centred[:, 2] - centred[:, :2] @ slopes


def _plane_axes(normal: np.ndarray) -> np.ndarray:
    """Rows are the plane's x (the first pose's x, made level), y and normal."""
    x = np.array([1.0, 0.0, 0.0]) - normal[0] * normal
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(normal, x), normal])


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
