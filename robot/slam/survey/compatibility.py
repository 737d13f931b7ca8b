"""Joint compatibility: which pairs of sights and landmarks can all be true at once.

Branch and bound over the sights of a frame (Neira and Tardos, "Data association in stochastic
mapping using the joint compatibility test", IEEE Trans. Robotics and Automation 2001). Every node
adds a pair, while the joint innovation, with the filter's correlations, can still pass the
chi-square test once all sights have a pair; the hypothesis that passes with the most pairs wins,
among equals the likeliest. Only what all about as likely ones agree in is believed, as one group of
things can look like another: not to know is better than to be wrong.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robot.slam.association import own_spread

_MAX_NODES = 2000  # beyond, the hypotheses found so far are all
_Z_99 = 2.326  # 99 % of a normal distribution


def chi2_99(dof: int) -> float:
    """The 99 % quantile of chi-square, to 0.5 %: Wilson and Hilferty (PNAS 1931)."""
    a = 2.0 / (9.0 * dof)
    return float(dof * (1.0 - a + _Z_99 * math.sqrt(a)) ** 3)


@dataclass(frozen=True, slots=True, eq=False)
class PairTable:
    """p possible pairs: sight and landmark indices (p,), innovation and its covariance.

    `residual` is (p, 2), `shared` (2 p, 2 p) is H P H^T of all, `noise` (p, 2, 2) of each sight.
    """

    sight: np.ndarray
    landmark: np.ndarray
    residual: np.ndarray
    shared: np.ndarray
    noise: np.ndarray

    def select(self, chosen: np.ndarray) -> PairTable:
        """Some of the pairs, by index or mask."""
        index = np.arange(len(self.sight))[chosen]
        shared = self.shared[np.ix_(_rows(index), _rows(index))]
        return PairTable(
            self.sight[index], self.landmark[index], self.residual[index], shared, self.noise[index]
        )

    def own(self) -> np.ndarray:
        """The innovation's covariance of each pair (p, 2, 2)."""
        return own_spread(self.shared, self.noise)

    def distance(self, chosen: list[int]) -> tuple[float, float]:
        """Squared Mahalanobis distance and log determinant of the pairs `chosen` together."""
        index = np.array(chosen)
        spread = self.shared[np.ix_(_rows(index), _rows(index))]
        for k in range(len(index)):
            spread[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] += self.noise[index[k]]
        lower = np.linalg.cholesky(spread)
        white = np.linalg.solve(lower, self.residual[index].reshape(-1))
        return float(white @ white), 2.0 * float(np.log(np.diag(lower)).sum())


def _rows(index: np.ndarray) -> np.ndarray:
    return np.asarray((2 * index[:, None] + np.arange(2)).reshape(-1))


class _Search:
    """The state of one branch-and-bound search; `found` are the costs and pairs of all hypotheses
    with the most pairs."""

    def __init__(self, table: PairTable, by_sight: list[list[int]]) -> None:
        self._table, self._by_sight = table, by_sight
        self._nodes = 0
        self._most = 1
        self.found: list[tuple[float, list[int]]] = []

    def descend(self, level: int, chosen: list[int], chi2: float) -> None:
        left = len(self._by_sight) - level
        if len(chosen) + left < self._most or self._nodes > _MAX_NODES:
            return
        if left == 0:
            if chi2 < chi2_99(2 * len(chosen)):
                self._keep(chosen)
            return
        used = {int(self._table.landmark[k]) for k in chosen}
        for k in self._by_sight[level]:
            if int(self._table.landmark[k]) in used:
                continue
            self._nodes += 1
            joint, _ = self._table.distance([*chosen, k])
            if joint < chi2_99(2 * (len(chosen) + left)):
                self.descend(level + 1, [*chosen, k], joint)
        if len(chosen) + left > self._most:
            self.descend(level + 1, chosen, chi2)

    def _keep(self, chosen: list[int]) -> None:
        if len(chosen) > self._most:
            self._most = len(chosen)
            self.found.clear()
        self.found.append((sum(self._table.distance(chosen)), list(chosen)))


def joint_compatibility(table: PairTable, margin: float) -> list[int]:
    """The pairs (indices into `table`) to believe.

    A pair stays only if every hypothesis of as many pairs without it costs `margin` more, in
    chi-square plus log determinant.
    """
    alone = [table.distance([k])[0] for k in range(len(table.sight))]
    by_sight = [
        sorted(np.flatnonzero(table.sight == i).tolist(), key=lambda k: alone[k])
        for i in np.unique(table.sight).tolist()
    ]
    by_sight.sort(key=len)  # the surest first: it prunes the rest
    search = _Search(table, by_sight)
    search.descend(0, [], 0.0)
    if not search.found:
        return []
    cost, best = min(search.found)
    good = [pairs for other, pairs in search.found if other < cost + margin]
    return [k for k in best if all(k in pairs for pairs in good)]
