"""How the robot moves: increments from wheels and gyro or from vision, and their composition.

An `Increment` is the planar motion of `base` between two times, in the earlier `base`, with its
noise and its derivative by the calibration (gyro bias, scale error of either wheel and of the track
width). Wheels give the distance and the gyro the turn; without a gyro the wheels give both.
Odometry on circular arcs: Thrun, Burgard, Fox, "Probabilistic Robotics" (2005), sections 5.3-5.4.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robot.geometry.se2 import SE2, wrap_angle

GYRO_BIAS, LEFT_SCALE, RIGHT_SCALE, TRACK_SCALE = range(4)  # order of the calibration vector


@dataclass(frozen=True, slots=True, eq=False)
class Steps:
    """Short consecutive pieces of an interval, as arrays (n,).

    `yaw_rad` is the gyro's turn, bias not removed, or None where there is no gyro.
    """

    duration_s: np.ndarray
    left_m: np.ndarray
    right_m: np.ndarray
    yaw_rad: np.ndarray | None


@dataclass(frozen=True, slots=True)
class OdometryNoise:
    """Random-walk strengths: variances grow with the distance rolled and with time."""

    wheel_m_per_sqrt_m: float
    gyro_rad_per_sqrt_s: float
    track_width_m: float


@dataclass(frozen=True, slots=True, eq=False)
class Increment:
    """Motion of `base`; `calibration_jacobian` (3, 4) is d(x, y, yaw) / d(calibration)."""

    previous_from_current: SE2
    calibration_jacobian: np.ndarray
    cov: np.ndarray


def wheel_increment(steps: Steps, calibration: np.ndarray, noise: OdometryNoise) -> Increment:
    """Chain of circular arcs along `steps`; `calibration` (4,) is in the order given above.

    A scale error e means that the wheel really rolled (1 + e) times what its encoder says, or that
    the track is (1 + e) times as wide as drawn.
    """
    left = steps.left_m * (1.0 + calibration[LEFT_SCALE])
    right = steps.right_m * (1.0 + calibration[RIGHT_SCALE])
    distance = 0.5 * (left + right)
    if steps.yaw_rad is None:
        width_m = noise.track_width_m * (1.0 + float(calibration[TRACK_SCALE]))
        turn = (right - left) / width_m
    else:
        turn = steps.yaw_rad - calibration[GYRO_BIAS] * steps.duration_s
    end, by_distance, by_turn = chain(distance, turn)

    var_left = noise.wheel_m_per_sqrt_m**2 * np.abs(left)
    var_right = noise.wheel_m_per_sqrt_m**2 * np.abs(right)
    by_left, by_right = 0.5 * by_distance, 0.5 * by_distance
    jacobian = np.zeros((3, 4))
    if steps.yaw_rad is None:
        by_left = by_left - by_turn / width_m
        by_right = by_right + by_turn / width_m
        jacobian[:, TRACK_SCALE] = -by_turn @ turn * (noise.track_width_m / width_m)
        cov = np.zeros((3, 3))
    else:
        jacobian[:, GYRO_BIAS] = -by_turn @ steps.duration_s
        cov = (by_turn * (noise.gyro_rad_per_sqrt_s**2 * steps.duration_s)) @ by_turn.T
    jacobian[:, LEFT_SCALE] = by_left @ steps.left_m
    jacobian[:, RIGHT_SCALE] = by_right @ steps.right_m
    cov += (by_left * var_left) @ by_left.T + (by_right * var_right) @ by_right.T
    return Increment(SE2(end[0], end[1], wrap_angle(end[2])), jacobian, cov)


def chain(
    distance_m: np.ndarray, turn_rad: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """End (3,) of a chain of arcs and its derivatives (3, n) by each distance and each turn."""
    half = 0.5 * turn_rad
    small = np.abs(half) < 1e-4
    safe = np.where(small, 1.0, half)
    chord = np.where(small, 1.0 - half * half / 6.0, np.sin(safe) / safe)
    chord_slope = np.where(small, -half / 6.0, 0.5 * (np.cos(safe) - chord) / safe)
    total = np.cumsum(turn_rad)
    middle = total - half
    c, s = np.cos(middle), np.sin(middle)
    dx, dy = distance_m * chord * c, distance_m * chord * s
    x, y = dx.sum(), dy.sum()
    # A turn swings everything that comes after it, and half of its own chord.
    after_x, after_y = x - np.cumsum(dx) + 0.5 * dx, y - np.cumsum(dy) + 0.5 * dy
    stretch = distance_m * chord_slope
    by_distance = np.stack([chord * c, chord * s, np.zeros_like(c)])
    by_turn = np.stack([stretch * c - after_y, stretch * s + after_x, np.ones_like(c)])
    yaw = float(total[-1]) if len(total) else 0.0
    return np.array([x, y, yaw]), by_distance, by_turn


def visual_increment(
    motion: SE2, cov: np.ndarray, gyro_yaw_rad: float | None, gyro_var_rad2: float
) -> Increment:
    """Motion seen by the camera, its yaw merged with the gyro's where there is one.

    The merge is one Kalman update of (x, y, yaw) with a measurement of yaw.
    """
    change = np.array([motion.x_m, motion.y_m, motion.yaw_rad])
    if gyro_yaw_rad is not None:
        gain = cov[:, 2] / (cov[2, 2] + gyro_var_rad2)
        change = change + gain * wrap_angle(gyro_yaw_rad - motion.yaw_rad)
        cov = cov - np.outer(gain, cov[2])
    x_m, y_m, yaw_rad = change.tolist()
    return Increment(SE2(x_m, y_m, wrap_angle(yaw_rad)), np.zeros((3, 4)), cov)


def compose(pose: np.ndarray, increment: SE2) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """g: the pose (3,) after `increment`; its Jacobians (3, 3) by the pose and the increment."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    dx, dy = c * increment.x_m - s * increment.y_m, s * increment.x_m + c * increment.y_m
    end = np.array([pose[0] + dx, pose[1] + dy, wrap_angle(float(pose[2]) + increment.yaw_rad)])
    by_pose = np.array([[1.0, 0.0, -dy], [0.0, 1.0, dx], [0.0, 0.0, 1.0]])
    by_increment = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return end, by_pose, by_increment
