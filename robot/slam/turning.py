"""Errors that turn with the heading: how a correction moves positions in an invariant filter.

The errors of all positions are kept in the frame that turns with the heading's error: the
right-invariant EKF of Barrau and Bonnabel, "An EKF-SLAM algorithm with consistency properties"
(2015), here in the coordinates of the plain one.

With xi = (turn, shift of each position), positions as complex numbers p and the change c that the
gain gives, a position becomes exp(xi) p, where shift = c - i p turn; that is
p + c (exp(i turn) - 1) / (i turn). Its error is shift + i p turn, so that the covariance must
follow p: P becomes (I + s e^T) P (I + e s^T), where the swing s is i times the way that each
position went, and e picks the heading.
"""

from __future__ import annotations

import cmath

import numpy as np

_SMALL_RAD = 1e-4


def bend(turn_rad: float) -> tuple[complex, complex]:
    """What a position's change is multiplied by when the heading's is `turn_rad`; its slope."""
    turn = 1j * turn_rad
    if abs(turn) < _SMALL_RAD:
        return 1.0 + 0.5 * turn, 1j * (0.5 + turn / 3.0)
    grown = cmath.exp(turn)
    return (grown - 1.0) / turn, 1j * (turn * grown - grown + 1.0) / turn**2


def multiply(entries: np.ndarray, factor: complex, positions: tuple[slice, ...]) -> None:
    """Multiply each pair of x and y among the entries (n,) in place."""
    for part in positions:
        pairs = entries[part].view(complex)
        np.multiply(pairs, factor, out=pairs)


def swing(way: np.ndarray, positions: tuple[slice, ...]) -> np.ndarray:
    """How each entry (n,) of the state swings with the heading, by the way that it went."""
    swung = np.zeros_like(way)
    for part in positions:
        np.multiply(way[part].view(complex), 1j, out=swung[part].view(complex))
    return swung
