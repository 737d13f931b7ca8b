"""How far an estimated track is from the true one.

A track is an array (n, 4) of t_s, x_m, y_m, yaw_rad, times ascending. The absolute trajectory
error is the RMS distance after the best rigid alignment (Sturm et al., IROS 2012), the alignment
of Umeyama (IEEE PAMI 1991) without scale, in the plane.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robot.geometry.se2 import SE2, wrap_angle

MAX_GAP_S = 0.5  # truth is interpolated over no longer gap
MIN_POSES = 2


@dataclass(frozen=True, slots=True)
class TrackError:
    """What comparing two tracks gives.

    `true_from_estimate` is the alignment of the first two figures; the `start` figures align the
    first common pose only, as the robot itself knows where it began.
    """

    ate_rmse_m: float
    yaw_rmse_rad: float
    start_rmse_m: float
    start_yaw_rmse_rad: float
    worst_m: float
    poses: int
    true_from_estimate: SE2


def compare_tracks(estimate: np.ndarray, truth: np.ndarray) -> TrackError | None:
    """Compare an estimated with a true track; None if they share fewer than two times."""
    estimate, truth = associate(estimate, truth)
    if len(estimate) < MIN_POSES:
        return None
    aligned = align(estimate[:, 1:3], truth[:, 1:3])
    distance = np.hypot(*(aligned.apply(estimate[:, 1:3]) - truth[:, 1:3]).T)
    start = SE2(*truth[0, 1:]) @ SE2(*estimate[0, 1:]).inverse()
    from_start = np.hypot(*(start.apply(estimate[:, 1:3]) - truth[:, 1:3]).T)
    return TrackError(
        ate_rmse_m=_rms(distance),
        yaw_rmse_rad=_rms(_yaw_error(estimate, truth, aligned)),
        start_rmse_m=_rms(from_start),
        start_yaw_rmse_rad=_rms(_yaw_error(estimate, truth, start)),
        worst_m=float(distance.max()),
        poses=len(estimate),
        true_from_estimate=aligned,
    )


def associate(
    estimate: np.ndarray, truth: np.ndarray, max_gap_s: float = MAX_GAP_S
) -> tuple[np.ndarray, np.ndarray]:
    """The estimates (m, 4) that have truth, and the truth (m, 4) interpolated at their times.

    Estimates outside the truth, or inside a gap of it longer than `max_gap_s`, are left out.
    """
    if len(estimate) == 0 or len(truth) == 0:
        return np.empty((0, 4)), np.empty((0, 4))
    t, true_t = estimate[:, 0], truth[:, 0]
    right = np.searchsorted(true_t, t).clip(0, len(true_t) - 1)
    left = np.where(true_t[right] == t, right, (right - 1).clip(0))
    inside = (true_t[left] <= t) & (t <= true_t[right])
    span = true_t[right] - true_t[left]
    keep = inside & (span <= max_gap_s)
    t, left, right, span = t[keep], left[keep], right[keep], span[keep]
    fraction = np.divide(t - true_t[left], span, out=np.zeros_like(t), where=span > 0)
    turn = np.remainder(truth[right, 3] - truth[left, 3] + math.pi, 2 * math.pi) - math.pi
    position = truth[left, 1:3] + fraction[:, None] * (truth[right, 1:3] - truth[left, 1:3])
    return estimate[keep], np.column_stack([t, position, truth[left, 3] + fraction * turn])


def align(points_m: np.ndarray, onto_m: np.ndarray) -> SE2:
    """The rigid motion that moves points (n, 2) onto their partners with least squares error.

    Umeyama (1991), equations 40 to 42, in the plane, where the rotation that maximises
    tr(R Sigma^T) has a closed form. Points that all coincide are only shifted.
    """
    mean, onto_mean = points_m.mean(axis=0), onto_m.mean(axis=0)
    a, b = points_m - mean, onto_m - onto_mean
    cosine = float(np.sum(a * b))
    sine = float(np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]))
    yaw = math.atan2(sine, cosine) if sine or cosine else 0.0
    rotated = SE2(0.0, 0.0, yaw).apply(mean)
    shift = onto_mean - rotated
    return SE2(float(shift[0]), float(shift[1]), wrap_angle(yaw))


def path_length_m(track: np.ndarray) -> float:
    """Length of a track (n, 4)."""
    return float(np.hypot(*np.diff(track[:, 1:3], axis=0).T).sum()) if len(track) > 1 else 0.0


def _yaw_error(estimate: np.ndarray, truth: np.ndarray, true_from_estimate: SE2) -> np.ndarray:
    error = estimate[:, 3] + true_from_estimate.yaw_rad - truth[:, 3]
    return np.asarray(np.remainder(error + math.pi, 2 * math.pi) - math.pi)


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
