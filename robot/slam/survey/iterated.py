"""The iterated update: after a long way without sights, one linear step is too crude.

Gauss-Newton on the posterior: Bell and Cathey, "The iterated Kalman filter update as a Gauss-Newton
method" (IEEE Trans. Automatic Control 1993); here over the change c that takes the prior to the
state x(c), which for the invariant filter turns all positions together.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from robot.slam.ekf import POSE, YAW, LandmarkFilter
from robot.slam.sensor import residual

_ITERATIONS = 8
_LARGE_STEP, _SMALL_STEP = 0.3, 0.01  # m or rad: such a first step needs others, till they end

Linearise = Callable[[], tuple[np.ndarray, np.ndarray, np.ndarray]]


def iterated_update(
    ekf: LandmarkFilter, linearise: Linearise, sights: np.ndarray, noise: np.ndarray
) -> None:
    """Update by sights (p, 2) with `noise` (p, 2, 2).

    `linearise` gives columns (p, 5) of pose and point, Jacobians (p, 2, 5) and expected sights
    (p, 2) about the filter's present state.
    """
    prior = ekf.x
    change = np.zeros(len(prior))
    p = len(sights)
    for step in range(_ITERATIONS):
        columns, jacobian, predicted = linearise()
        ekf.x = prior
        jacobian = _by_change(ekf, jacobian, change[columns])
        away = residual(sights, predicted) + (jacobian @ change[columns][:, :, None])[..., 0]
        prepared = ekf.innovation(columns, jacobian)
        spread = prepared[1].copy()
        np.einsum("iaib->iab", spread.reshape(p, 2, p, 2))[:] += noise
        found = np.linalg.solve(spread, away.reshape(-1)) @ prepared[0][:, : len(prior)]
        moved = float(np.abs(found - change)[POSE].max())
        if moved < (_SMALL_STEP if step else _LARGE_STEP):
            break
        change = found
        ekf.x = ekf.changed(change)
    ekf.x = prior
    ekf.update(columns, jacobian, away, noise, prepared)


def _by_change(ekf: LandmarkFilter, jacobian: np.ndarray, change: np.ndarray) -> np.ndarray:
    """Derivatives (p, 2, 5) by the change (p, 5) from those by the state."""
    bend, slope = ekf.bend(float(change[0, YAW]))
    turned = np.array([[bend.real, -bend.imag], [bend.imag, bend.real]])
    swing = np.array([[slope.real, -slope.imag], [slope.imag, slope.real]])
    by_change = jacobian.copy()
    for part in (slice(0, 2), slice(3, 5)):
        by_change[:, :, part] = jacobian[:, :, part] @ turned
        by_change[:, :, YAW] += (jacobian[:, :, part] @ (change[:, part] @ swing.T)[:, :, None])[
            ..., 0
        ]
    return by_change
