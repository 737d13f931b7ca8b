"""Which sight shows which landmark.

A followed track keeps its landmark. A new one is compared with all landmarks by place (the
innovation's Mahalanobis distance), height and signature. All pairs of a frame must then agree:
each pair in turn is taken as true, the others are predicted given it (with the filter's own
correlations), and the hypothesis under which they fit best wins. This is the one-point RANSAC of
Civera et al., "1-Point RANSAC for EKF Filtering" (J. Field Robotics 2010), run over every pair
instead of a random few, so that it is deterministic.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robot.config import SlamConfig
from robot.slam.catalogue import Catalogue, Observations
from robot.slam.ekf import FIRST_LANDMARK, POSE, LandmarkFilter
from robot.slam.sensor import expected, headings, residual, wrap

_BOLD = 6.0  # times narrower than the filter's own idea: a pair that would move the pose far


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """p sights (`seen`) with the landmarks they may show, linearised for the filter."""

    seen: np.ndarray  # (p,) index among the observations
    landmark: np.ndarray  # (p,)
    fresh: np.ndarray  # (p,) bool: found by signature now, not by its track
    loose_m: np.ndarray  # (p,) how far the landmark may have moved since it was last seen
    residual: np.ndarray  # (p, 2)
    noise: np.ndarray  # (p, 2, 2)
    columns: np.ndarray  # (p, 5) state entries
    jacobian: np.ndarray  # (p, 2, 5)
    hp: np.ndarray  # (2 p, n) H P
    hph: np.ndarray  # (2 p, 2 p) H P H^T

    def __len__(self) -> int:
        return len(self.seen)

    def select(self, kept: np.ndarray) -> Pairs:
        """Only the pairs of the mask or the indices `kept`."""
        kept = np.flatnonzero(kept) if kept.dtype == bool else kept
        rows = (2 * kept[:, None] + np.arange(2)).reshape(-1)
        return Pairs(
            self.seen[kept],
            self.landmark[kept],
            self.fresh[kept],
            self.loose_m[kept],
            self.residual[kept],
            self.noise[kept],
            self.columns[kept],
            self.jacobian[kept],
            self.hp[rows],
            self.hph[np.ix_(rows, rows)],
        )

    def innovation(self, ekf: LandmarkFilter) -> tuple[np.ndarray, np.ndarray]:
        """H P and H P H^T for the filter as it is now."""
        return _innovation(ekf, self.columns, self.jacobian, self.loose_m)


def pair_up(
    ekf: LandmarkFilter,
    catalogue: Catalogue,
    seen: Observations,
    loose_m: np.ndarray,
    config: SlamConfig,
) -> Pairs:
    """All plausible pairs: by track, then by place and signature; one sight per landmark.

    `loose_m` (n,) is by how much each landmark may have moved since it was last seen.
    """
    bound = catalogue.bound(seen.track)
    by_track = np.flatnonzero(bound >= 0)
    _, first = np.unique(bound[by_track], return_index=True)
    by_track = by_track[np.sort(first)]
    free = np.flatnonzero(bound < 0)
    found, landmark = _candidates(ekf, catalogue, seen, loose_m, free, bound[by_track], config)
    index = np.concatenate([by_track, found])
    target = np.concatenate([bound[by_track], landmark])
    fresh = np.arange(len(index)) >= len(by_track)
    return _linearise(ekf, seen, index, target, fresh, loose_m[target])


def _linearise(
    ekf: LandmarkFilter,
    seen: Observations,
    index: np.ndarray,
    landmark: np.ndarray,
    fresh: np.ndarray,
    loose_m: np.ndarray,
) -> Pairs:
    predicted, by_pose, by_point = expected(ekf.x[POSE], ekf.landmarks()[landmark])
    first = FIRST_LANDMARK + 2 * landmark[:, None]
    columns = np.hstack([np.tile(np.arange(3), (len(index), 1)), first, first + 1])
    jacobian = np.concatenate([by_pose, by_point], axis=2)
    away = residual(seen.sight[index], predicted)
    hp, hph = _innovation(ekf, columns, jacobian, loose_m)
    return Pairs(index, landmark, fresh, loose_m, away, seen.cov[index], columns, jacobian, hp, hph)


def _innovation(
    ekf: LandmarkFilter, columns: np.ndarray, jacobian: np.ndarray, loose_m: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """H P and H P H^T as they will be once the landmarks are loosened by `loose_m` (p,)."""
    hp, hph = ekf.innovation(columns, jacobian)
    for i in np.flatnonzero(loose_m):
        by_point = jacobian[i, :, 3:]
        rows = slice(2 * i, 2 * i + 2)
        hp[rows, columns[i, 3:]] += by_point * loose_m[i] ** 2
        hph[rows, rows] += by_point @ by_point.T * loose_m[i] ** 2
    return hp, hph


def _candidates(
    ekf: LandmarkFilter,
    catalogue: Catalogue,
    seen: Observations,
    loose_m: np.ndarray,
    free: np.ndarray,
    taken: np.ndarray,
    config: SlamConfig,
) -> tuple[np.ndarray, np.ndarray]:
    """Sights among `free` and the landmark that alone fits each by place and looks."""
    none = np.zeros(0, dtype=int)
    if not len(free) or not len(catalogue):
        return none, none
    distance = mahalanobis(ekf, seen.sight[free], seen.cov[free], loose_m)
    fits = distance < config.gate_chi2
    fits &= seen.kind[free][:, None] == catalogue.kinds()[None]
    rise = np.abs(seen.height_m[free][:, None] - catalogue.heights_m()[None])
    reach = config.height_gate_m + config.height_gate_slope * seen.range_m[free]
    fits &= ~(rise > reach[:, None])  # an unknown height excludes nothing
    fits &= catalogue.facing(headings(ekf.x[POSE], seen.sight[free]))
    fits[:, taken] = False
    rows = np.flatnonzero(fits.any(axis=1))
    if not len(rows):
        return none, none
    columns = np.flatnonzero(fits.any(axis=0))
    near = np.ix_(rows, columns)
    bits = catalogue.hamming(seen.bits[free[rows]], columns)
    alike = fits[near] & (bits <= config.max_hamming)
    cost = np.where(alike, distance[near] + config.hamming_weight * bits, np.inf)
    found, landmark = _unambiguous(cost, config.ambiguity)
    return free[rows[found]], columns[landmark]


def _unambiguous(cost: np.ndarray, margin: float) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of the cheapest pairs; who has a second choice as good stays unmatched."""
    cost = cost.copy()
    rows: list[int] = []
    columns: list[int] = []
    while np.isfinite(cost).any():
        row, column = divmod(int(np.argmin(cost)), cost.shape[1])
        best = cost[row, column]
        cost[row, column] = np.inf
        if min(cost[row].min(), cost[:, column].min()) >= best + margin:
            rows.append(row)
            columns.append(column)
        cost[row] = np.inf
        cost[:, column] = np.inf
    return np.array(rows, dtype=int), np.array(columns, dtype=int)


def mahalanobis(
    ekf: LandmarkFilter, sights: np.ndarray, cov: np.ndarray, loose_m: np.ndarray | None = None
) -> np.ndarray:
    """Squared Mahalanobis distances (m, n) of sights (m, 2), with `cov`, to all landmarks."""
    return quadratic(*pair_spread(ekf, sights, cov, loose_m))


def pair_spread(
    ekf: LandmarkFilter, sights: np.ndarray, cov: np.ndarray, loose_m: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Innovations (m, n, 2) of sights (m, 2), with `cov`, under all landmarks; covariances."""
    predicted, by_pose, by_point = expected(ekf.x[POSE], ekf.landmarks())
    mixed = by_pose @ ekf.pose_covs() @ by_point.transpose(0, 2, 1)
    spread = by_pose @ ekf.head()[POSE, POSE] @ by_pose.transpose(0, 2, 1)
    spread += mixed + mixed.transpose(0, 2, 1)
    place = ekf.landmark_covs()
    if loose_m is not None:
        place = place + (loose_m**2)[:, None, None] * np.eye(2)
    spread += by_point @ place @ by_point.transpose(0, 2, 1)
    away = sights[:, None, :] - predicted[None]
    away[..., 1] = wrap(away[..., 1])
    return away, spread[None] + cov[:, None]


def quadratic(vector: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """v^T M^-1 v for arrays of 2-vectors and symmetric (2, 2) matrices."""
    a, b, c = matrix[..., 0, 0], matrix[..., 0, 1], matrix[..., 1, 1]
    x, y = vector[..., 0], vector[..., 1]
    return (c * x * x - 2.0 * b * x * y + a * y * y) / (a * c - b * b)


def agreement(pairs: Pairs, gate_chi2: float, unfelt: np.ndarray) -> np.ndarray:
    """Squared distances (p,) of all pairs under the best one-pair hypothesis.

    `unfelt` (3, 1): direction and size of a pose error that the filter does not expect (slip); it
    widens the prior here and only here.
    """
    p = len(pairs)
    if p == 0:
        return np.zeros(0)
    swing = pairs.jacobian[:, :, :3].reshape(2 * p, 3) @ unfelt
    joint = (pairs.hph + swing @ swing.T).reshape(p, 2, p, 2).transpose(0, 2, 1, 3)
    each = np.arange(p)
    own = joint[each, each] + pairs.noise
    gain = joint @ np.linalg.inv(own)[None]  # [j, i]: what i teaches about j
    away = pairs.residual[:, None] - (gain @ pairs.residual[None, :, :, None])[..., 0]
    spread = own[:, None] - gain @ joint.transpose(1, 0, 2, 3)
    away[each, each] = pairs.residual
    spread[each, each] = own
    distance = quadratic(away, spread)
    determinant = spread[..., 0, 0] * spread[..., 1, 1] - spread[..., 0, 1] ** 2
    floor = np.linalg.det(pairs.noise)[:, None]
    cost = np.minimum(distance + np.log(np.maximum(determinant / floor, 1e-9)), gate_chi2 + 3.0)
    return distance[:, int(np.argmin(cost.sum(axis=0)))]


def bold(pairs: Pairs) -> np.ndarray:
    """Mask (p,) of the pairs that tell far more than the filter knows by itself."""
    spread = own_spread(pairs.hph, pairs.noise)
    return np.asarray(np.linalg.det(spread) > _BOLD**2 * np.linalg.det(pairs.noise))


def own_spread(hph: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """The innovation's covariance of each pair by itself (p, 2, 2), from H P H^T of all."""
    p = len(noise)
    return np.asarray(hph.reshape(p, 2, p, 2)[np.arange(p), :, np.arange(p)] + noise)


@dataclass(frozen=True, slots=True, eq=False)
class PoseEvidence:
    """What the innovations of a frame say about an error of the pose that nobody expects.

    The score test of Willsky and Jones (IEEE Trans. Automatic Control 1976): `information` (3, 3)
    is J^T S^-1 J and `pull` (3,) is J^T S^-1 residual, J the derivative by the pose.
    """

    information: np.ndarray
    pull: np.ndarray

    def along(self, direction: np.ndarray) -> tuple[float, np.ndarray]:
        """Chi-square (1 dof) of an error along `direction` (3,), and the likeliest error (3,)."""
        weight = float(direction @ self.information @ direction)
        pull = float(direction @ self.pull)
        return pull * pull / weight, direction * (pull / weight)

    def any_way(self) -> tuple[float, np.ndarray]:
        """Chi-square (3 dof) of any error, and the likeliest one (3,)."""
        weak = 1e-9 * np.trace(self.information) * np.eye(3)  # one pair alone leaves a direction
        error = np.linalg.solve(self.information + weak, self.pull)
        return float(self.pull @ error), error


def pose_evidence(pairs: Pairs) -> PoseEvidence:
    """Evidence of one pair or more."""
    p = len(pairs)
    spread = pairs.hph.copy()
    for i in range(p):
        spread[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] += pairs.noise[i]
    by_pose = pairs.jacobian[:, :, :3].reshape(2 * p, 3)
    weighted = np.linalg.solve(spread, np.column_stack([by_pose, pairs.residual.reshape(-1)]))
    return PoseEvidence(by_pose.T @ weighted[:, :3], by_pose.T @ weighted[:, 3])
