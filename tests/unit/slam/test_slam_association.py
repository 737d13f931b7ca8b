"""Who is who among clutter."""

import math

import numpy as np
import pytest

from robot.config import SlamConfig
from robot.slam.association import Pairs, agreement, pair_up, pose_evidence
from robot.slam.catalogue import BITS, Catalogue, Entry, Observations
from robot.slam.ekf import FIRST_LANDMARK, POSE, LandmarkFilter
from robot.slam.landmark_map import LandmarkMap
from robot.slam.sensor import expected

CONFIG = SlamConfig()
AHEAD = np.array([1.0, 0.0])
NOISE = np.diag([0.02**2, 0.005**2])


class Room:
    """Landmarks around the robot, known to the filter, and ways to look at them."""

    def __init__(self, seed: int, count: int = 20, sigma_m: float = 0.05) -> None:
        self.rng = np.random.default_rng(seed)
        angle = self.rng.uniform(-0.6, 0.6, count)
        far = self.rng.uniform(0.6, 3.0, count)
        self.places = np.stack([far * np.cos(angle), far * np.sin(angle)], axis=1)
        self.bits = np.where(self.rng.uniform(size=(count, 256)) < 0.5, -1.0, 1.0).astype("f4")
        self.heights = self.rng.uniform(0.05, 1.0, count)
        self.ekf = LandmarkFilter(np.array([sigma_m, sigma_m, 0.03] + [0.0] * 7))
        small = np.tile(0.01 * np.eye(2), (count, 1, 1))
        self.ekf.add(self.places, np.zeros((count, 2, 3)), small, np.tile(np.eye(2), (count, 1, 1)))
        self.catalogue = Catalogue()
        for i in range(count):
            self.catalogue.add(0, self.heights[i], self.bits[i], AHEAD, 1000 + i, 0)

    def look(
        self, pose: np.ndarray, which: np.ndarray, tracks: np.ndarray, flips: float = 0.06
    ) -> Observations:
        sight = expected(pose, self.places[which])[0]
        sight = sight + self.rng.normal(0, 1, sight.shape) * np.sqrt(np.diag(NOISE))
        turned = self.rng.uniform(size=(len(which), 256)) < flips
        return Observations(
            sight,
            np.tile(NOISE, (len(which), 1, 1)),
            1.0 / sight[:, 0],
            np.zeros(len(which), dtype=int),
            self.heights[which],
            tracks,
            np.where(turned, -self.bits[which], self.bits[which]),
        )

    def fixed(self) -> np.ndarray:
        return np.zeros(len(self.catalogue))

    def accepted(self, seen: Observations) -> tuple[Pairs, np.ndarray]:
        pairs = pair_up(self.ekf, self.catalogue, seen, self.fixed(), CONFIG)
        return pairs, agreement(pairs, CONFIG.gate_chi2, np.zeros((3, 1))) < CONFIG.gate_chi2


@pytest.mark.parametrize("seed", range(5))
def test_new_tracks_find_their_landmarks_by_signature(seed: int) -> None:
    room = Room(seed)
    pose = np.array([0.06, -0.05, 0.03])
    which = room.rng.permutation(20)[:12]
    pairs, fits = room.accepted(room.look(pose, which, np.arange(12)))
    assert pairs.fresh.all() and fits.sum() >= 10
    assert np.array_equal(pairs.landmark[fits], which[pairs.seen[fits]])


@pytest.mark.parametrize("seed", range(5))
def test_clutter_with_strange_signatures_is_not_matched(seed: int) -> None:
    room = Room(seed)
    which = np.arange(10)
    seen = room.look(np.zeros(3), which, np.arange(10))
    seen.bits[5:] = -seen.bits[5:]  # as unlike as can be
    pairs, _ = room.accepted(seen)
    assert set(pairs.seen.tolist()) <= set(range(5)) and len(pairs) >= 4


def test_a_track_keeps_its_landmark_whatever_it_looks_like() -> None:
    room = Room(3)
    which = np.array([4, 9, 2, 11, 7])
    pairs, fits = room.accepted(room.look(np.zeros(3), which, 1000 + which, flips=0.4))
    assert not pairs.fresh.any() and fits.all()
    assert np.array_equal(np.sort(pairs.landmark), np.sort(which))


def test_tracks_that_jumped_are_outvoted() -> None:
    room = Room(4)
    which = np.arange(12)
    seen = room.look(np.array([0.05, 0.05, 0.02]), which, 1000 + which)
    seen.sight[:4, 1] += 0.2
    pairs, fits = room.accepted(seen)
    assert set(pairs.seen[~fits].tolist()) == {0, 1, 2, 3}


def test_twins_side_by_side_stay_unmatched() -> None:
    room = Room(5, count=6)
    room.places[1] = room.places[0] + 0.005
    room.ekf.x[FIRST_LANDMARK + 2 : FIRST_LANDMARK + 4] = room.places[1]
    room.catalogue.entries[1].bits = room.catalogue.entries[0].bits
    room.catalogue.entries[1].height_m = room.catalogue.entries[0].height_m
    pairs, _ = room.accepted(room.look(np.zeros(3), np.array([0, 3]), np.array([1, 2])))
    assert pairs.seen.tolist() == [1] and pairs.landmark.tolist() == [3]


def test_other_heights_and_kinds_do_not_match() -> None:
    room = Room(6)
    seen = room.look(np.zeros(3), np.arange(4), np.arange(4))
    seen.height_m[:2] += 0.4
    seen.kind[2] = 1
    pairs, _ = room.accepted(seen)
    assert pairs.seen.tolist() == [3]
    seen.height_m[:] = math.nan  # unknown height excludes nothing
    pairs, _ = room.accepted(seen)
    assert sorted(pairs.seen.tolist()) == [0, 1, 3]


def test_a_wall_papered_alike_on_both_sides_has_two_faces() -> None:
    room = Room(6)
    for entry in room.catalogue.entries[:2]:
        entry.along = -AHEAD
    room.catalogue.entries[2].along = np.array([-0.1, 0.05])  # a leg, seen from all around
    room.catalogue.entries[3].along = np.full(2, math.nan)  # of an older map
    pairs, _ = room.accepted(room.look(np.zeros(3), np.arange(5), np.arange(5)))
    assert sorted(pairs.seen.tolist()) == [2, 3, 4]


def test_the_side_from_which_it_is_seen_is_learned() -> None:
    entry = Entry(0, 0, 0.3, [np.ones(BITS)], 0, 1, 0, 0)
    for yaw_rad, along in ((0.0, (1.0, 0.0)), (math.pi / 2, (0.5, 0.5)), (math.pi, (0.0, 1 / 3))):
        line = np.array([math.cos(yaw_rad), math.sin(yaw_rad)])
        entry.learn(np.ones(BITS), 0.3, line, 1)
        assert entry.along == pytest.approx(along)


def test_nothing_seen_and_nothing_known() -> None:
    room = Room(7)
    empty = room.look(np.zeros(3), np.zeros(0, dtype=int), np.zeros(0, dtype=int))
    pairs, fits = room.accepted(empty)
    assert len(pairs) == 0 and fits.shape == (0,)
    fresh = LandmarkFilter(np.full(FIRST_LANDMARK, 0.1))
    seen = room.look(np.zeros(3), np.arange(3), np.arange(3))
    assert len(pair_up(fresh, Catalogue(), seen, np.zeros(0), CONFIG)) == 0


def seen_again(vague: float, count: int, off_m: float = 0.0) -> list[bool]:
    """Which of `count` landmarks long unseen are believed; the last one is sighted too far."""
    room, t_ns = Room(9, sigma_m=0.3), 100_000_000_000
    room.ekf.P *= vague
    known, entries = LandmarkMap(CONFIG, room.ekf), room.catalogue.entries
    known.entries = entries
    for i, entry in enumerate(entries):
        entry.sightings, entry.last_seen_ns = 20, t_ns - 100_000_000 if i < 6 else 0
    known._catalogue.by_track = {1000 + i: entries[i] for i in range(6)}
    which = np.r_[:6, 10 : 10 + count]
    seen = room.look(np.zeros(3), which, np.r_[1000:1006, 1 : 1 + count])
    seen.sight[-1, 0] += off_m
    known.correct(seen, t_ns, 0.0)
    assert all(entry.last_seen_ns == t_ns for entry in entries[:6])
    return [entry.last_seen_ns == t_ns for entry in entries[10 : 10 + count]]


@pytest.mark.parametrize(("vague", "count", "again"), [(1.0, 2, 0), (1.0, 3, 3), (0.001, 1, 1)])
def test_a_vague_pose_is_told_by_several_that_were_long_unseen(
    vague: float, count: int, again: int
) -> None:
    assert sum(seen_again(vague, count)) == again


def test_what_was_long_unseen_must_fit_well() -> None:
    off_m = 3.0 * math.sqrt(NOISE[0, 0])
    assert seen_again(1.0, 4, off_m) == [True, True, True, False]
    assert seen_again(0.001, 4, off_m) == [True] * 4  # it cannot move a pose that is known


def test_slip_is_found_and_measured() -> None:
    room = Room(8, sigma_m=0.003)
    room.ekf.P[2, 2] = 0.002**2
    which = np.arange(20)
    forward = np.array([1.0, 0.0, 0.0])
    still, _ = room.accepted(room.look(np.zeros(3), which, 1000 + which))
    assert pose_evidence(still).along(forward)[0] < 9.0
    assert pose_evidence(still).any_way()[0] < 16.0
    seen = room.look(np.array([-0.06, 0.0, 0.0]), which, 1000 + which)
    evidence = pose_evidence(pair_up(room.ekf, room.catalogue, seen, room.fixed(), CONFIG))
    for chi2, error in (evidence.along(forward), evidence.any_way()):
        assert chi2 > 25.0
        assert error == pytest.approx([-0.06, 0.0, 0.0], abs=0.02)
    assert room.ekf.x[POSE] == pytest.approx(np.zeros(3))
