"""Whether an estimator knows how wrong it is, and whether it knew what it saw.

NEES: the normalised estimation error squared, e^T P^-1 e, has the mean of its degrees of freedom
for an estimator whose covariance P is honest (Bar-Shalom, Li, Kirubarajan, "Estimation with
Applications to Tracking and Navigation" (2001), section 5.4). Errors are taken in the frame in
which the track is aligned with the truth.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable
from statistics import NormalDist

import numpy as np

from robot.evaluate.trajectory import align
from robot.geometry.se2 import SE2


def chi2_quantile(dof: int, probability: float) -> float:
    """Quantile of chi-square, to 1 % for three and more dof: Wilson and Hilferty (PNAS 1931)."""
    a = 2.0 / (9.0 * dof)
    return float(dof * (1.0 - a + NormalDist().inv_cdf(probability) * math.sqrt(a)) ** 3)


def nees(
    estimate: np.ndarray, covs: np.ndarray, truth: np.ndarray, true_from_estimate: SE2
) -> np.ndarray:
    """NEES (n,) of poses: tracks (n, 4) of t_s, x_m, y_m, yaw_rad at the same times.

    `covs` (n, 3, 3) are of (x, y, yaw) in the frame of the estimate.
    """
    c, s = math.cos(true_from_estimate.yaw_rad), math.sin(true_from_estimate.yaw_rad)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    error = np.empty((len(estimate), 3))
    error[:, :2] = true_from_estimate.apply(estimate[:, 1:3]) - truth[:, 1:3]
    yaw = estimate[:, 3] + true_from_estimate.yaw_rad - truth[:, 3]
    error[:, 2] = np.remainder(yaw + math.pi, 2.0 * math.pi) - math.pi
    whitened = np.linalg.solve(turn @ covs @ turn.T, error[:, :, None])[:, :, 0]
    return np.asarray((error * whitened).sum(axis=1))


class AssociationTally:
    """Counts which true thing each landmark was taken for."""

    def __init__(self) -> None:
        self._seen: defaultdict[int, Counter[int]] = defaultdict(Counter)

    def count(self, landmarks: Iterable[int], things: Iterable[int]) -> None:
        """Sights (pairs) of a frame; landmark -1 means that the sight was not used."""
        for landmark, thing in zip(landmarks, things, strict=True):
            if landmark >= 0:
                self._seen[landmark][thing] += 1

    def thing(self, landmark: int) -> int | None:
        """What a landmark is: the thing that it showed most often."""
        seen = self._seen.get(landmark)
        return max(seen, key=lambda thing: (seen[thing], -thing)) if seen else None

    def wrong_pct(self) -> float | None:
        """Share of the used sights that showed another thing than their landmark is."""
        total = sum(sum(seen.values()) for seen in self._seen.values())
        right = sum(max(seen.values()) for seen in self._seen.values())
        return 100.0 * (total - right) / total if total else None


def best_share_rmse_m(estimate: np.ndarray, truth: np.ndarray, share: float = 0.9) -> float:
    """RMS distance (positions (n, 2)) of the best `share` of the points, aligned by themselves.

    For truth with jumps, such as GPS under trees.
    """
    count = max(2, round(share * len(estimate)))
    kept = np.arange(len(estimate))
    for _ in range(10):
        moved = align(estimate[kept], truth[kept]).apply(estimate)
        distance = np.hypot(*(moved - truth).T)
        kept = np.sort(np.argsort(distance, kind="stable")[:count])
    return float(np.sqrt(np.mean(np.square(distance[kept]))))
