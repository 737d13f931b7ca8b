"""EKF-SLAM over plain range-bearing sights: with names, or without any looks to tell them apart.

The robot's own landmarks carry signatures and tracks; recordings of other robots do not. This uses
the same filter, measurement model and joint tests for them, with odometry that learns the scales
and the lag of ordered speeds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robot.slam.association import mahalanobis, quadratic
from robot.slam.ekf import FIRST_LANDMARK, POSE, LandmarkFilter
from robot.slam.motion import compose
from robot.slam.sensor import expected, locate, residual, sights_of
from robot.slam.survey.compatibility import PairTable, joint_compatibility
from robot.slam.survey.datum import Datum
from robot.slam.survey.iterated import iterated_update
from robot.slam.survey.novelty import novelty_cost
from robot.slam.survey.readings import CHI2_2_99, Readings
from robot.slam.survey.settings import SurveySettings
from robot.slam.survey.velocity import Velocities, velocity_increment

_ABSURD_CHI2 = 13.8  # 99.9 %: a named sight so far off carries a wrong name
_READINGS = 2  # of a name in the same place, before it stays a landmark or makes a leap:
_BOLD = 100.0  # what tells so much more than the filter knows
_T_DOF = 4.0  # of Student's distribution, which weighs outliers down
_REFUSALS = 5
_AWAY_S = 5.0  # what was not seen for so long comes into view again
_WAYMARK = -2  # the name of a place where the base was, which nobody sees


@dataclass(slots=True, eq=False)
class Known:
    """One landmark of the filter, or a waymark."""

    name: int
    sights: int
    last_s: float
    refused: int = 0  # sights in a row that were absurd


class Survey:
    """Maps while moving. Pure: orders and frames in, poses out."""

    def __init__(self, settings: SurveySettings, orders: np.ndarray, named: bool) -> None:
        """`orders` (n, 3): t_s, v_mps, yaw_rate_radps; `named`: sights tell what they show."""
        s = self._settings = settings
        calibration = [s.curvature_sigma, s.speed_scale_sigma, s.turn_scale_sigma, s.lag_sigma_s]
        sigma = np.array([*s.start_sigma, *calibration, *[1.0] * 3])
        self.ekf = LandmarkFilter(sigma, s.invariant)
        self._orders = Velocities(orders)
        self._named = named
        self.known: list[Known] = []
        needed = _READINGS if named else s.confirmations
        self._readings = Readings(needed, s.confirm_within_s)
        self.t_s: float | None = None
        self._born = 0
        self._datum = Datum()
        self._again = 0  # known things that came into view

    def move(self, t_s: float) -> None:
        """Predict up to `t_s`."""
        if self.t_s is None or t_s <= self.t_s:
            self.t_s = t_s if self.t_s is None else self.t_s
            return
        self._predict(self.t_s, t_s)
        self.t_s = t_s
        if self._datum.due(t_s):
            self._datum.leave(self.ekf, t_s)
            self.known.append(Known(_WAYMARK, 0, t_s))
            self._keep(np.delete(np.arange(self.ekf.count), self._waymarks()[self._datum.thin()]))

    def _predict(self, start_s: float, end_s: float) -> None:
        increment = velocity_increment(
            self._orders, start_s, end_s, self.ekf.calibration, self._settings.noise
        )
        end, by_pose, by_increment = compose(self.ekf.x[POSE], increment.previous_from_current)
        self.ekf.predict(
            end,
            by_pose,
            by_increment @ increment.calibration_jacobian,
            by_increment @ increment.cov @ by_increment.T,
            np.array(self._settings.walk) ** 2 * (end_s - start_s),
        )

    def pose(self) -> tuple[np.ndarray, np.ndarray]:
        """Pose (3,) and covariance (3, 3) at the time moved to, in the frame of the datum."""
        return self._datum.pose(self.ekf)

    def see(self, polar: np.ndarray, names: np.ndarray | None = None) -> np.ndarray:
        """Take in a frame of sights (m, 2); returns the landmark names (m,), -1 for none.

        With `named`, the names are the given ones; otherwise each new landmark gets a number.
        """
        sights, cov = sights_of(polar, self._noise(polar))
        if self._named and names is not None:
            table, new = self._named_pairs(sights, cov, names)
            chosen = list(range(len(table.sight)))
        else:
            table, chosen, new = self._likely_pairs(sights, cov)
        matched = np.full(len(polar), -1)
        for k in chosen:
            matched[table.sight[k]] = self.known[int(table.landmark[k])].name
        self._correct(sights, cov, table, chosen)
        self._grow(sights, cov, np.flatnonzero((matched < 0) & new), names, matched)
        return matched

    def map(self) -> tuple[list[int], np.ndarray, np.ndarray]:
        """Names, places (n, 2) and covariances (n, 2, 2) of the landmarks, in the same frame."""
        seen = np.flatnonzero([landmark.name != _WAYMARK for landmark in self.known])
        told = self._datum.points(self.ekf.landmarks()[seen], self.ekf.landmark_covs()[seen])
        return [self.known[i].name for i in seen.tolist()], *told

    # ------------------------------------------------------------ pairing

    def _noise(self, polar: np.ndarray) -> np.ndarray:
        s = self._settings
        noise = np.zeros((len(polar), 2, 2))
        noise[:, 0, 0] = s.range_m**2 + (s.inverse_range_per_m * polar[:, 0] ** 2) ** 2
        noise[:, 1, 1] = s.bearing_rad**2
        return noise

    def _likely_pairs(
        self, sights: np.ndarray, cov: np.ndarray
    ) -> tuple[PairTable, list[int], np.ndarray]:
        """Pairs by place, those to believe, and the mask (m,) of sights of nothing known."""
        distance = mahalanobis(self.ekf, sights, cov)
        distance[:, self._waymarks()] = np.inf
        table = self._table(sights, cov, *np.nonzero(distance < CHI2_2_99))
        chosen = joint_compatibility(table, self._settings.margin)
        if chosen and not self._known_again(table, chosen, sights):
            chosen = []
        distance[:, table.landmark[chosen]] = np.inf  # two sights of a frame show two things
        near = distance.min(axis=1, initial=np.inf)
        return table, chosen, near > self._settings.new_beyond_chi2

    def _known_again(self, table: PairTable, chosen: list[int], sights: np.ndarray) -> bool:
        """Whether the pairs `chosen` are likelier than as many new things."""
        landmarks = np.delete(self.ekf.landmarks(), self._waymarks(), axis=0)
        away_m = np.hypot(*(landmarks - self.ekf.x[:2]).T)
        range_m = 1.0 / sights[table.sight[chosen], 0]
        rival = novelty_cost(range_m, away_m, self._born, self._again)
        return sum(table.distance(chosen)) < rival

    def _named_pairs(
        self, sights: np.ndarray, cov: np.ndarray, names: np.ndarray
    ) -> tuple[PairTable, np.ndarray]:
        """The pairs by name that are plausible, and the mask (m,) of names never heard."""
        known = np.array([landmark.name for landmark in self.known], dtype=int)
        sight, landmark = np.nonzero(names[:, None] == known[None])
        distance = mahalanobis(self.ekf, sights, cov)[sight, landmark]
        kept = self._plausible(landmark, distance)
        table = self._table(sights, cov, sight[kept], landmark[kept])
        return table.select(self._confirmed(sights, table)), ~np.isin(names, known)

    def _table(
        self, sights: np.ndarray, cov: np.ndarray, sight: np.ndarray, landmark: np.ndarray
    ) -> PairTable:
        columns, jacobian, predicted = self._linearise(landmark)
        _, shared = self.ekf.innovation(columns, jacobian)
        return PairTable(sight, landmark, residual(sights[sight], predicted), shared, cov[sight])

    def _confirmed(self, sights: np.ndarray, pairs: PairTable) -> np.ndarray:
        """Mask (p,) of the named pairs that are no leap, or were read before in the same place."""
        assert self.t_s is not None
        sure = np.linalg.det(pairs.own()) < _BOLD**2 * np.linalg.det(pairs.noise)
        places, _, by_sight = locate(self.ekf.x[POSE], sights[pairs.sight])
        spread = by_sight @ pairs.noise @ by_sight.transpose(0, 2, 1)
        for k in np.flatnonzero(~sure).tolist():
            name = self.known[int(pairs.landmark[k])].name
            sure[k] = self._readings.add(places[k], spread[k], name, self.t_s)
        return np.asarray(sure)

    def _plausible(self, landmark: np.ndarray, distance: np.ndarray) -> np.ndarray:
        """Which named sights (p,) can be true; a landmark refused too often was placed wrongly."""
        plausible = distance < _ABSURD_CHI2
        for index, fits in zip(landmark.tolist(), plausible.tolist(), strict=True):
            self.known[index].refused = 0 if fits else self.known[index].refused + 1
        return np.asarray(plausible)

    def _linearise(self, landmark: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Columns (p, 5), Jacobians (p, 2, 5) and expected sights (p, 2)."""
        predicted, by_pose, by_point = expected(self.ekf.x[POSE], self.ekf.landmarks()[landmark])
        first = FIRST_LANDMARK + 2 * landmark[:, None]
        columns = np.hstack([np.tile(np.arange(3), (len(landmark), 1)), first, first + 1])
        return columns, np.concatenate([by_pose, by_point], axis=2), predicted

    # ------------------------------------------------------------ correcting

    def _correct(
        self, sights: np.ndarray, cov: np.ndarray, table: PairTable, chosen: list[int]
    ) -> None:
        if not chosen:
            return
        assert self.t_s is not None
        pairs = table.select(np.array(chosen))
        sight, landmark = pairs.sight, pairs.landmark
        columns, jacobian, _ = self._linearise(landmark)
        since_s = self.t_s - np.array([self.known[int(j)].last_s for j in landmark])
        self._again += int((since_s > _AWAY_S).sum())
        repeated = 1.0 + 2.0 * self._settings.correlated_s / np.maximum(since_s, 0.02)
        noise = pairs.noise * repeated[:, None, None]
        chi2 = quadratic(pairs.residual, pairs.own() - pairs.noise + noise)
        noise /= ((_T_DOF + 2.0) / (_T_DOF + chi2)).clip(max=1.0)[:, None, None]
        if self._named:
            iterated_update(self.ekf, lambda: self._linearise(landmark), sights[sight], noise)
        else:  # a leap on the strength of a guessed name is better a short one
            self.ekf.update(columns, jacobian, pairs.residual, noise)
        self._datum.follow(self.ekf.landmarks()[self._waymarks()])
        for j in landmark.tolist():
            self.known[j].sights += 1
            self.known[j].last_s = self.t_s

    # ------------------------------------------------------------ growing and forgetting

    def _grow(
        self,
        sights: np.ndarray,
        cov: np.ndarray,
        fresh: np.ndarray,
        names: np.ndarray | None,
        matched: np.ndarray,
    ) -> None:
        """Let new things wait until they were seen again in the same place, then append them."""
        assert self.t_s is not None
        self._readings.expire(self.t_s)
        if len(fresh):
            places, by_pose, by_sight = locate(self.ekf.x[POSE], sights[fresh])
            own = by_sight @ cov[fresh] @ by_sight.transpose(0, 2, 1)
            ripe = []
            for k in range(len(fresh)):
                name = int(names[fresh[k]]) if self._named and names is not None else -1
                if self._named or self._readings.add(places[k], own[k], name, self.t_s):
                    ripe.append(k)
            if ripe:
                self.ekf.add(places[ripe], by_pose[ripe], by_sight[ripe], cov[fresh[ripe]])
            for k in ripe:
                name = int(names[fresh[k]]) if self._named and names is not None else self._born
                self._born += 1
                self.known.append(Known(name, 1, self.t_s))
                matched[fresh[k]] = name
        self._forget()

    def _forget(self) -> None:
        """Drop what was seen a few times only and never again, or was placed by a false sight."""
        self._keep(np.flatnonzero([self._worth_keeping(landmark) for landmark in self.known]))

    def _keep(self, kept: np.ndarray) -> None:
        if len(kept) < len(self.known):
            self.ekf.keep(kept)
            self.known = [self.known[i] for i in kept.tolist()]

    def _waymarks(self) -> np.ndarray:
        """Indices (n,) of the waymarks among what the filter knows."""
        return np.flatnonzero([landmark.name == _WAYMARK for landmark in self.known])

    def _worth_keeping(self, landmark: Known) -> bool:
        assert self.t_s is not None
        s = self._settings
        if landmark.name == _WAYMARK:  # the datum lets those go
            return True
        if self._named:
            read_again = landmark.sights >= _READINGS
            fresh = self.t_s - landmark.last_s < s.confirm_within_s
            return landmark.refused < min(_REFUSALS, landmark.sights) and (read_again or fresh)
        return landmark.sights >= s.ghost_sights or self.t_s - landmark.last_s < s.ghost_after_s
