"""Derivatives by central differences: what every Jacobian is checked against."""

from collections.abc import Callable

import numpy as np


def derivative(
    function: Callable[[np.ndarray], np.ndarray], at: np.ndarray, step: float = 1e-6
) -> np.ndarray:
    """Jacobian (outputs, inputs) of `function` at `at` (inputs,)."""
    columns = []
    for i in range(len(at)):
        ahead, behind = at.astype(float), at.astype(float)
        ahead[i] += step
        behind[i] -= step
        columns.append((function(ahead) - function(behind)).reshape(-1) / (2.0 * step))
    return np.stack(columns, axis=1)
