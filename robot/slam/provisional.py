"""Sights that are not landmarks yet: they must come back in the same place first."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robot.config import SlamConfig
from robot.slam.catalogue import BITS, Observations

_GATE_CHI2 = 9.2  # 99 % of two degrees of freedom
_FORGET_NS = 2_000_000_000


@dataclass(slots=True, eq=False)
class Candidate:
    """A place in `world` with its covariance, and how often it was confirmed."""

    place: np.ndarray
    cov: np.ndarray
    kind: int
    bits: np.ndarray
    track: int
    sightings: int
    last_ns: int


class Waiting:
    """The candidates of the last seconds, by track or, where nothing follows them, by place."""

    def __init__(self, config: SlamConfig) -> None:
        self._config = config
        self._tracked: dict[int, Candidate] = {}
        self._untracked: list[Candidate] = []

    def confirm(
        self,
        seen: Observations,
        index: np.ndarray,
        places: np.ndarray,
        covs: np.ndarray,
        t_ns: int,
    ) -> np.ndarray:
        """Take in the sights `index`, at `places` (m, 2) with `covs`; return those now ripe."""
        self._expire(t_ns)
        ripe = []
        for i, place, cov in zip(index.tolist(), places, covs, strict=True):
            candidate = self._find(seen, i, place, cov)
            if candidate is None or not self._fits(candidate, place, cov):
                self._put(Candidate(place, cov, *self._looks(seen, i), 1, t_ns))
                continue
            self._merge(candidate, place, cov, seen.bits[i], t_ns)
            if candidate.sightings >= self._config.provisional_sightings:
                ripe.append(i)
        sightings = self._config.provisional_sightings
        self._untracked = [c for c in self._untracked if c.sightings < sightings]
        return np.array(ripe, dtype=int)

    def drop(self, tracks: np.ndarray) -> None:
        """Forget the candidates of tracks that became landmarks."""
        for track in tracks.tolist():
            self._tracked.pop(track, None)

    @staticmethod
    def _looks(seen: Observations, i: int) -> tuple[int, np.ndarray, int]:
        return int(seen.kind[i]), seen.bits[i], int(seen.track[i])

    def _put(self, candidate: Candidate) -> None:
        if candidate.track >= 0:
            self._tracked[candidate.track] = candidate
        else:
            self._untracked.append(candidate)

    def _find(
        self, seen: Observations, i: int, place: np.ndarray, cov: np.ndarray
    ) -> Candidate | None:
        if seen.track[i] >= 0:
            return self._tracked.get(int(seen.track[i]))
        reach = 2.0 * self._config.max_hamming  # in bits that differ, twice the Hamming distance
        near = [
            c
            for c in self._untracked
            if c.kind == seen.kind[i]
            and BITS - float(seen.bits[i] @ c.bits) <= reach
            and self._fits(c, place, cov)
        ]
        return min(near, key=lambda c: float(np.hypot(*(c.place - place))), default=None)

    @staticmethod
    def _fits(candidate: Candidate, place: np.ndarray, cov: np.ndarray) -> bool:
        away = place - candidate.place
        return float(away @ np.linalg.solve(candidate.cov + cov, away)) < _GATE_CHI2

    @staticmethod
    def _merge(
        candidate: Candidate, place: np.ndarray, cov: np.ndarray, bits: np.ndarray, t_ns: int
    ) -> None:
        gain = candidate.cov @ np.linalg.inv(candidate.cov + cov)
        candidate.place = candidate.place + gain @ (place - candidate.place)
        candidate.cov = candidate.cov - gain @ candidate.cov
        candidate.bits = bits
        candidate.sightings += 1
        candidate.last_ns = t_ns

    def _expire(self, t_ns: int) -> None:
        oldest = t_ns - _FORGET_NS
        self._tracked = {t: c for t, c in self._tracked.items() if c.last_ns >= oldest}
        self._untracked = [c for c in self._untracked if c.last_ns >= oldest]
