"""Motion of a base that only tells what it was ordered: speed and turn rate, late and mis-scaled.

The calibration that the filter learns is (curvature rad/m, speed scale error, turn scale error,
lag s): the base does at time t what was ordered at t - lag, times (1 + scale error), and drifts off
a straight by the curvature.
Odometry on circular arcs: Thrun, Burgard, Fox, "Probabilistic Robotics" (2005), section 5.3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robot.geometry.se2 import SE2, wrap_angle
from robot.slam.motion import Increment, chain

CURVATURE, SPEED_SCALE, TURN_SCALE, LAG = range(4)  # order of the calibration vector
_LAG_STEP_S = 0.02  # for the derivative by the lag, which orders that jump leave without one


@dataclass(frozen=True, slots=True)
class VelocityNoise:
    """Random walks: variances grow with the distance, with the turn and with time in motion."""

    speed_m_per_sqrt_m: float
    turn_rad_per_sqrt_m: float
    turn_rad_per_sqrt_rad: float
    sideways_m_per_sqrt_m: float


class Velocities:
    """Orders (n, 3) of t_s, v_mps, yaw_rate_radps, each holding until the next."""

    def __init__(self, orders: np.ndarray) -> None:
        self._t_s = orders[:, 0]
        self._rates = orders[:, 1:]

    def between(self, start_s: float, end_s: float) -> tuple[np.ndarray, np.ndarray]:
        """Durations (k,) and rates (k, 2) that make up an interval; still before the first."""
        first, last = np.searchsorted(self._t_s, (start_s, end_s), side="right")
        cuts = np.concatenate([[start_s], self._t_s[first:last], [end_s]])
        index = np.arange(first - 1, last)
        rates = np.where(index[:, None] >= 0, self._rates[index], 0.0)
        return np.diff(cuts), rates


def velocity_increment(
    orders: Velocities,
    start_s: float,
    end_s: float,
    calibration: np.ndarray,
    noise: VelocityNoise,
) -> Increment:
    """Motion from `start_s` to `end_s` under `calibration` (4,), with its derivatives."""
    lag_s = float(calibration[LAG])
    duration_s, rates = orders.between(start_s - lag_s, end_s - lag_s)
    distance, turn = _driven(duration_s, rates, calibration)
    end, by_distance, by_turn = chain(distance, turn)
    travel = rates[:, 0] * duration_s
    jacobian = np.zeros((3, 4))
    jacobian[:, CURVATURE] = by_turn @ distance
    jacobian[:, SPEED_SCALE] = by_distance @ travel + by_turn @ (calibration[CURVATURE] * travel)
    jacobian[:, TURN_SCALE] = by_turn @ (rates[:, 1] * duration_s)
    jacobian[:, LAG] = _by_lag(orders, start_s, end_s, calibration)
    rolled, turned = np.abs(distance), np.abs(turn)
    var_distance = noise.speed_m_per_sqrt_m**2 * rolled
    var_turn = noise.turn_rad_per_sqrt_m**2 * rolled + noise.turn_rad_per_sqrt_rad**2 * turned
    cov = (by_distance * var_distance) @ by_distance.T + (by_turn * var_turn) @ by_turn.T
    cov[1, 1] += noise.sideways_m_per_sqrt_m**2 * float(rolled.sum())
    return Increment(SE2(end[0], end[1], wrap_angle(end[2])), jacobian, cov)


def _driven(
    duration_s: np.ndarray, rates: np.ndarray, calibration: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Distance and turn (k,) of each piece."""
    distance = rates[:, 0] * (1.0 + calibration[SPEED_SCALE]) * duration_s
    turn = rates[:, 1] * (1.0 + calibration[TURN_SCALE]) * duration_s
    return distance, turn + calibration[CURVATURE] * distance


def _by_lag(
    orders: Velocities, start_s: float, end_s: float, calibration: np.ndarray
) -> np.ndarray:
    """Central difference (3,) of the motion by the lag."""
    ends = []
    for step_s in (_LAG_STEP_S, -_LAG_STEP_S):
        lag_s = float(calibration[LAG]) + step_s
        duration_s, rates = orders.between(start_s - lag_s, end_s - lag_s)
        ends.append(chain(*_driven(duration_s, rates, calibration))[0])
    return np.asarray(ends[0] - ends[1]) / (2.0 * _LAG_STEP_S)
