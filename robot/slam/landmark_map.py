"""What a frame teaches: corrections by known landmarks, and which landmarks are kept."""

from __future__ import annotations

import math

import numpy as np

from robot.config import SlamConfig
from robot.messages import Marker
from robot.slam.asleep import GROUP, Sleepers
from robot.slam.association import (
    Pairs,
    PoseEvidence,
    agreement,
    bold,
    own_spread,
    pair_up,
    pose_evidence,
    quadratic,
)
from robot.slam.catalogue import Catalogue, Entry, Observations
from robot.slam.doubles import merge_doubles
from robot.slam.ekf import MARKER, POSE, YAW, LandmarkFilter
from robot.slam.provisional import Waiting
from robot.slam.sensor import expected_marker, headings, locate, locate_marker, residual

_MARKER_GATE_CHI2 = 16.3  # 99.9 % of three degrees of freedom
_ODD_CHI2 = 21.1  # 99.99 % of three degrees of freedom: the frame contradicts the pose
_ODD_FRAMES = 5  # contradicting in a row before they are believed: somebody pushed the robot
_MAX_SLIP_M = 0.2
_REFUSALS = 4  # sightings that do not fit before a track loses its landmark
_GHOST_NS = 4_000_000_000
_MIN_SIGHTINGS = 5
_PRUNE_NS = 1_000_000_000


class LandmarkMap:
    """The measuring half of the filter: associate, test, correct, add, forget."""

    def __init__(self, config: SlamConfig, ekf: LandmarkFilter) -> None:
        self._config = config
        self._ekf = ekf
        self._catalogue = Catalogue()
        self._waiting = Waiting(config)
        self._sleepers = Sleepers()
        self.marker_known = False
        self._pruned_ns = 0
        self._odd_frames = 0

    def correct(self, seen: Observations, t_ns: int, ahead_m: float) -> None:
        """Correct pose and landmarks by one frame; `ahead_m` was driven since the last one."""
        self._catalogue.forget_tracks(seen.track)
        loose_m = self._catalogue.looseness_m(t_ns, self._config.view_sigma_m)
        pairs = pair_up(self._ekf, self._catalogue, seen, loose_m, self._config)
        used = self._apply(pairs, seen, t_ns, ahead_m)
        self._grow(seen, used, t_ns)
        room = self._config.max_landmarks - len(self._catalogue)
        self._catalogue.extend(self._sleepers.wake(self._ekf, self.entries, room))
        if t_ns - self._pruned_ns > _PRUNE_NS:
            self._pruned_ns = t_ns
            self._prune(t_ns)

    @property
    def entries(self) -> list[Entry]:
        """What is known of each landmark of the filter, in its order."""
        return self._catalogue.entries

    @entries.setter
    def entries(self, entries: list[Entry]) -> None:
        self._catalogue = Catalogue(entries)
        self._sleepers = Sleepers()

    def whole(self) -> tuple[LandmarkFilter, list[Entry]]:
        """A copy of the filter with all landmarks awake, and their entries in its order."""
        return self._sleepers.whole(self._ekf, self.entries)

    def familiar(self, t_ns: int, age_ns: int) -> int:
        """How many of the landmarks seen at `t_ns` were known `age_ns` before."""
        return self._catalogue.familiar(t_ns, age_ns)

    def move_on(self, born_after_ns: int) -> None:
        """The robot is elsewhere: nothing is followed any more, what was new is not believed."""
        self._catalogue.by_track.clear()
        self._waiting = Waiting(self._config)
        self._odd_frames = 0
        born = np.array([entry.born_ns for entry in self._catalogue.entries], dtype=np.int64)
        kept = np.flatnonzero(born <= born_after_ns)
        if len(kept) < len(born):
            self._ekf.keep(kept)
            self._catalogue.keep(kept)
        self._sleepers.forget(self.entries, born_after_ns)

    def correct_by_marker(self, marker: Marker) -> None:
        """Anchor to the dock's marker: its first sight places it, later ones correct the pose."""
        pose = marker.base_from_marker
        if math.hypot(pose.x_m, pose.y_m) > self._config.marker_range_m:
            return
        seen = np.array([pose.x_m, pose.y_m, pose.yaw_rad])
        noise = self._config.marker_noise_factor * marker.cov
        if not self.marker_known:
            self._ekf.place_marker(*locate_marker(self._ekf.x[POSE], seen), noise)
            self.marker_known = True
            return
        predicted, jacobian = expected_marker(self._ekf.x[POSE], self._ekf.x[MARKER])
        columns = np.array([[0, 1, 2, *range(MARKER.start, MARKER.stop)]])
        away = residual(seen[None], predicted[None])
        hp, hph = self._ekf.innovation(columns, jacobian[None])
        chi2 = float(away[0] @ np.linalg.solve(hph + noise, away[0]))
        if chi2 < _MARKER_GATE_CHI2:
            self._ekf.update(columns, jacobian[None], away, noise[None], (hp, hph))

    # ------------------------------------------------------------ correcting

    def _apply(self, pairs: Pairs, seen: Observations, t_ns: int, ahead_m: float) -> np.ndarray:
        """Update by the pairs that agree; returns which sights (m,) are spoken for.

        What was mapped a moment ago moves with the pose and always agrees: where the pose is
        vague, only others long unseen can confirm one that was, and all must fit well, as a wide
        gate lets in what is not the same.
        """
        spoken_for = np.zeros(len(seen), dtype=bool)
        spoken_for[pairs.seen[~pairs.fresh]] = True
        yaw = self._ekf.x[YAW]
        slip = -ahead_m * np.array([math.cos(yaw), math.sin(yaw), 0.0])
        distance = agreement(pairs, self._config.gate_chi2, 0.5 * slip[:, None])
        fits = distance < self._config.gate_chi2
        if fits.sum() < self._config.consensus:
            fits &= ~pairs.fresh
        returning = fits & pairs.fresh & (pairs.loose_m > 0.0) & bold(pairs)
        fits &= ~returning | (distance < self._config.again_chi2)
        if (returning & fits).sum() < self._config.consensus_again:
            fits &= ~returning
        good = pairs.select(self._best(fits, seen, pairs))
        if not self._update(good, slip):
            return spoken_for
        for i in np.flatnonzero(~fits & ~pairs.fresh).tolist():
            self._refuse(int(seen.track[pairs.seen[i]]))
        for i in np.flatnonzero(fits).tolist():
            self._learn(pairs, i, seen, t_ns)
            spoken_for[pairs.seen[i]] = True
        return spoken_for

    def _best(self, fits: np.ndarray, seen: Observations, pairs: Pairs) -> np.ndarray:
        """At most `max_observations` of the pairs that fit, nearest first."""
        index = np.flatnonzero(fits)
        order = np.argsort(seen.range_m[pairs.seen[index]], kind="stable")
        return np.sort(index[order[: self._config.max_observations]])

    def _update(self, pairs: Pairs, slip: np.ndarray) -> bool:
        """Correct the state, unless the frame as a whole contradicts it; says whether it did."""
        if not len(pairs):
            return True
        prepared = pairs.hp, pairs.hph
        evidence = pose_evidence(pairs)
        missed = self._missed_motion(evidence, slip, len(pairs))
        if missed is not None:
            self._ekf.inflate(np.outer(missed, missed))
            prepared = pairs.innovation(self._ekf)
        elif evidence.any_way()[0] > _ODD_CHI2:
            self._odd_frames += 1
            return False
        self._odd_frames = 0
        self._ekf.loosen(pairs.landmark, pairs.loose_m)
        noise = pairs.noise / self._weights(pairs, prepared[1])[:, None, None]
        self._ekf.update(pairs.columns, pairs.jacobian, pairs.residual, noise, prepared)
        return True

    def _missed_motion(
        self, evidence: PoseEvidence, slip: np.ndarray, count: int
    ) -> np.ndarray | None:
        """Pose error (3,) that no honest odometry leaves: slip, or a push that lasts."""
        if count < self._config.consensus:
            return None
        length = float(np.hypot(*slip[:2]))
        if length > 0.0:
            chi2, error = evidence.along(slip / length)
            back_m = float(error @ slip) / length  # wheels that slip promise too much, never less
            if chi2 > self._config.slip_chi2 and 0.0 < back_m < _MAX_SLIP_M:
                return error
        chi2, error = evidence.any_way()
        pushed = self._odd_frames >= _ODD_FRAMES and count >= 2 * self._config.consensus
        return error if chi2 > _ODD_CHI2 and pushed else None

    def _weights(self, pairs: Pairs, hph: np.ndarray) -> np.ndarray:
        """Huber's weights (p,) from each pair's own innovation."""
        chi2 = quadratic(pairs.residual, own_spread(hph, pairs.noise))
        return np.minimum(1.0, np.sqrt(self._config.huber_chi2 / np.maximum(chi2, 1e-9)))

    def _refuse(self, track: int) -> None:
        entry = self._catalogue.by_track[track]
        entry.refused += 1
        if entry.refused >= _REFUSALS:
            del self._catalogue.by_track[track]
            entry.refused = 0

    def _learn(self, pairs: Pairs, i: int, seen: Observations, t_ns: int) -> None:
        entry = self._catalogue.entries[int(pairs.landmark[i])]
        sight, track = int(pairs.seen[i]), int(seen.track[pairs.seen[i]])
        if pairs.fresh[i]:
            entry.visits += t_ns - entry.last_seen_ns > _GHOST_NS
            if track >= 0:
                self._catalogue.by_track[track] = entry
                self._waiting.drop(np.array([track]))
        along = headings(self._ekf.x[POSE], seen.sight[[sight]])[0]
        entry.learn(seen.bits[sight], float(seen.height_m[sight]), along, t_ns)

    # ------------------------------------------------------------ growing and forgetting

    def _grow(self, seen: Observations, spoken_for: np.ndarray, t_ns: int) -> None:
        """Let unknown sights wait, and append the ripe ones where few landmarks are in view."""
        index = np.flatnonzero(~spoken_for & (seen.range_m < self._config.init_range_m))
        places, _, by_sight = locate(self._ekf.x[POSE], seen.sight[index])
        covs = by_sight @ seen.cov[index] @ by_sight.transpose(0, 2, 1)
        ripe = self._waiting.confirm(seen, index, places, covs, t_ns)
        chosen = self._choose(seen, ripe, spoken_for)
        if not len(chosen):
            return
        position, by_pose, by_seen = locate(self._ekf.x[POSE], seen.sight[chosen])
        self._ekf.add(position, by_pose, by_seen, seen.cov[chosen])
        along = headings(self._ekf.x[POSE], seen.sight[chosen])
        for i, line in zip(chosen.tolist(), along, strict=True):
            looks = int(seen.kind[i]), float(seen.height_m[i]), seen.bits[i], line
            self._catalogue.add(*looks, int(seen.track[i]), t_ns)
        self._waiting.drop(seen.track[chosen])

    def _choose(self, seen: Observations, ripe: np.ndarray, spoken_for: np.ndarray) -> np.ndarray:
        """Spread new landmarks over the view and the room; the nearest first."""
        sectors = self._config.sectors
        part = np.clip((seen.sight[:, 1] + 0.65) / 1.3 * sectors, 0, sectors - 1).astype(int)
        crowd = np.bincount(part[spoken_for], minlength=sectors)
        places, _, _ = locate(self._ekf.x[POSE], seen.sight)
        known, heights = self._ekf.landmarks(), self._catalogue.heights_m()
        chosen: list[int] = []
        for i in ripe[np.argsort(seen.range_m[ripe], kind="stable")].tolist():
            far = np.hypot(*(known - places[i]).T) >= self._config.spacing_m
            far |= np.abs(heights - seen.height_m[i]) > self._config.height_gate_m
            if crowd[part[i]] < self._config.landmarks_per_sector and far.all():
                known = np.vstack([known, places[i]])
                heights = np.append(heights, seen.height_m[i])
                crowd[part[i]] += 1
                chosen.append(i)
        return np.array(chosen, dtype=int)

    def _prune(self, t_ns: int) -> None:
        """Drop doubles and ghosts; beyond the bound what is crowded; let far ones sleep."""
        kept = ~merge_doubles(self._ekf, self._catalogue, self._config)
        idle = np.array([t_ns - entry.last_seen_ns for entry in self.entries])
        sightings = np.array([entry.sightings for entry in self.entries])
        kept &= self._anchors() | (sightings >= _MIN_SIGHTINGS) | (idle <= _GHOST_NS)
        bound = self._config.max_landmarks
        if kept.sum() > bound:
            value = self._value(t_ns)
            self._drop_least(kept, value, ~self._uncrowded(value))
            if (surplus := int(kept.sum()) - bound) > 0:
                free = kept & (idle > _GHOST_NS)
                kept &= ~self._sleepers.put_away(self._ekf, self.entries, free, surplus + GROUP)
            self._drop_least(kept, value, kept)
        if not kept.all():
            index = np.flatnonzero(kept)
            self._ekf.keep(index)
            self._catalogue.keep(index)

    def _anchors(self) -> np.ndarray:
        """Mask (n,) of what others that sleep are known by."""
        return np.array([entry.anchor for entry in self.entries], dtype=bool)

    def _drop_least(self, kept: np.ndarray, value: np.ndarray, among: np.ndarray) -> None:
        """Take the least useful of the mask `among` (n,) out of `kept`, down to the bound."""
        index = np.flatnonzero(kept & among & ~self._anchors())
        index = index[np.argsort(value[index], kind="stable")]
        kept[index[: max(0, int(kept.sum()) - self._config.max_landmarks)]] = False

    def _uncrowded(self, value: np.ndarray) -> np.ndarray:
        """Mask (n,) of the most useful landmarks of each square metre."""
        cells = np.floor(self._ekf.landmarks()).astype(int)
        order = np.argsort(-value, kind="stable")
        count: dict[tuple[int, ...], int] = {}
        good = np.zeros(len(cells), dtype=bool)
        for i in order.tolist():
            cell = tuple(cells[i].tolist())
            count[cell] = count.get(cell, 0) + 1
            good[i] = count[cell] <= self._config.landmarks_per_m2
        return good

    def _value(self, t_ns: int) -> np.ndarray:
        """How useful each landmark (n,) is: found again often, seen often, alone, in view now."""
        entries = self._catalogue.entries
        places = self._ekf.landmarks()
        near = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1)) < 0.3
        value = np.array([e.visits + min(e.sightings, 100) / 50.0 for e in entries])
        in_view = np.array([t_ns - e.last_seen_ns < _GHOST_NS for e in entries])
        return value / near.sum(axis=1) + 100.0 * in_view
