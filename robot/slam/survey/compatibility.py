"""Joint compatibility: which pairs of sights and landmarks can all be true at once.

Branch and bound over the sights of a frame (Neira and Tardos, "Data association in stochastic
mapping using the joint compatibility test", IEEE Trans. Robotics and Automation 2001). Every node
adds a pair, while the joint innovation, with the filter's correlations, can still pass the
chi-square test once all sights have a pair; the hypothesis that passes with the most pairs wins,
among equals the nearest. Pairs for which another
landmark would do about as well are left out: not to know is better than to be wrong.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

_MAX_NODES = 400  # beyond, the best hypothesis found so far is taken
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

    def distance(self, chosen: list[int]) -> tuple[float, float]:
        """Squared Mahalanobis distance and log determinant of the pairs `chosen` together."""
        index = np.array(chosen)
        rows = (2 * index[:, None] + np.arange(2)).reshape(-1)
        spread = self.shared[np.ix_(rows, rows)]
        for k in range(len(index)):
            spread[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] += self.noise[index[k]]
        lower = np.linalg.cholesky(spread)
        white = np.linalg.solve(lower, self.residual[index].reshape(-1))
        return float(white @ white), 2.0 * float(np.log(np.diag(lower)).sum())


class _Search:
    """The state of one branch-and-bound search."""

    def __init__(self, table: PairTable, by_sight: list[list[int]]) -> None:
        self._table, self._by_sight = table, by_sight
        self._nodes = 0
        self.best: list[int] = []
        self._best_chi2 = math.inf

    def descend(self, level: int, chosen: list[int], chi2: float) -> None:
        left = len(self._by_sight) - level
        if len(chosen) + left < len(self.best) or self._nodes > _MAX_NODES:
            return
        if left == 0:
            if chosen and chi2 >= chi2_99(2 * len(chosen)):
                return
            if (len(chosen), -chi2) > (len(self.best), -self._best_chi2):
                self.best, self._best_chi2 = list(chosen), chi2
            return
        used = {int(self._table.landmark[k]) for k in chosen}
        for k in self._by_sight[level]:
            if int(self._table.landmark[k]) in used:
                continue
            self._nodes += 1
            joint, _ = self._table.distance([*chosen, k])
            if joint < chi2_99(2 * (len(chosen) + left)):
                self.descend(level + 1, [*chosen, k], joint)
        if len(chosen) + left - 1 >= len(self.best):
            self.descend(level + 1, chosen, chi2)


def joint_compatibility(table: PairTable, margin: float) -> list[int]:
    """The pairs (indices into `table`) to believe.

    A pair stays only if every other landmark in its place would cost `margin` more, in
    chi-square plus log determinant.
    """
    if not len(table.sight):
        return []
    alone = [table.distance([k])[0] for k in range(len(table.sight))]
    by_sight = [
        sorted(np.flatnonzero(table.sight == i).tolist(), key=lambda k: alone[k])
        for i in np.unique(table.sight).tolist()
    ]
    by_sight.sort(key=len)  # the surest first: it prunes the rest
    search = _Search(table, by_sight)
    search.descend(0, [], 0.0)
    return [k for k in search.best if _alone_fits(table, search.best, k, margin)]


def _alone_fits(table: PairTable, best: list[int], k: int, margin: float) -> bool:
    """Whether no other landmark could as well be what the sight of pair `k` shows."""
    cost = sum(table.distance(best))
    used = {int(table.landmark[other]) for other in best}
    rest = [other for other in best if other != k]
    for rival in np.flatnonzero(table.sight == table.sight[k]).tolist():
        if int(table.landmark[rival]) in used:
            continue
        if sum(table.distance([*rest, rival])) < cost + margin:
            return False
    return True
