"""Sights that wait: what was seen several times in one place is there, a false sight is not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

CHI2_2_99 = 9.21  # 99 % of two degrees of freedom
_WANDER_M = 0.02  # between two sights of a thing the pose errs about so much


@dataclass(slots=True, eq=False)
class Reading:
    """Something seen from remembered poses: where (2,) in `world`, with covariance (2, 2)."""

    place: np.ndarray
    cov: np.ndarray
    name: int
    count: int
    last_s: float

    def fits(self, place: np.ndarray, cov: np.ndarray) -> bool:
        """Whether another sight may show the same place."""
        away = place - self.place
        return float(away @ np.linalg.solve(self.cov + cov, away)) < CHI2_2_99

    def merge(self, place: np.ndarray, cov: np.ndarray, t_s: float) -> None:
        """Take in another sight of the same place: a Kalman update."""
        gain = self.cov @ np.linalg.inv(self.cov + cov)
        self.place = self.place + gain @ (place - self.place)
        self.cov = self.cov - gain @ self.cov + _WANDER_M**2 * np.eye(2)
        self.count += 1
        self.last_s = t_s


class Readings:
    """All that waits to be seen `needed` times, no more than `within_s` apart."""

    def __init__(self, needed: int, within_s: float) -> None:
        self._needed, self._within_s = needed, within_s
        self._waiting: list[Reading] = []

    def expire(self, t_s: float) -> None:
        """Drop what was not seen again."""
        self._waiting = [r for r in self._waiting if r.last_s >= t_s - self._within_s]

    def add(self, place: np.ndarray, cov: np.ndarray, name: int, t_s: float) -> bool:
        """Take in a sight; whether it was now seen often enough, and waits no longer."""
        for reading in self._waiting:
            if reading.name != name or reading.last_s == t_s or not reading.fits(place, cov):
                continue
            reading.merge(place, cov, t_s)
            if reading.count < self._needed:
                return False
            self._waiting.remove(reading)
            return True
        if self._needed > 1:
            self._waiting.append(Reading(place, cov, name, 1, t_s))
        return self._needed <= 1
