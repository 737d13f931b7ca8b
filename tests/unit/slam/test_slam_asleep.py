"""Landmarks that sleep, wake where their anchors are; the awake state stays small."""

import numpy as np
import pytest

from robot.slam.asleep import GROUP, Sleepers, put_to_sleep, state_entries, wake_up
from robot.slam.catalogue import BITS, Entry
from robot.slam.ekf import FIRST_LANDMARK, POSE, LandmarkFilter
from robot.slam.sensor import expected, locate


def entry(index: int, anchor: bool = False, born_ns: int = 0) -> Entry:
    return Entry(index, 0, 0.3, [np.ones(BITS, np.float32)], 9, 1, born_ns, 0, anchor=anchor)


def mapped(rng: np.random.Generator, count: int) -> tuple[LandmarkFilter, np.ndarray]:
    """A filter that has `count` landmarks around it, seen from a doubtful pose."""
    things = rng.uniform(-3.0, 3.0, (count, 2))
    ekf = LandmarkFilter(np.array([0.2, 0.2, 0.05] + [0.01] * 4 + [1.0] * 3), invariant=True)
    sights, _, _ = expected(np.zeros(3), things)
    ekf.add(*locate(ekf.x[POSE], sights), np.tile(np.diag([0.01, 0.01]) ** 2, (count, 1, 1)))
    return ekf, things


def test_who_wakes_at_once_has_lost_only_what_the_anchors_do_not_tell() -> None:
    ekf, _ = mapped(np.random.default_rng(1), 12)
    before, x = ekf.P.copy(), ekf.x.copy()
    entries = [entry(i, anchor=i < 5) for i in range(12)]
    group = put_to_sleep(ekf, entries[8:], entries[:5])
    ekf.keep(np.arange(8))
    wake_up(ekf, group)
    a, b = state_entries(np.arange(5)), state_entries(np.arange(8, 12))
    assert ekf.x == pytest.approx(x, abs=1e-12)
    both = np.ix_(np.concatenate([a, b]), np.concatenate([a, b]))
    assert ekf.P[both] == pytest.approx(before[both], abs=1e-10)
    rest = np.arange(len(a) + FIRST_LANDMARK, 26)
    assert ekf.P[np.ix_(rest, rest)] == pytest.approx(before[np.ix_(rest, rest)], abs=1e-12)
    np.linalg.cholesky(ekf.P)
    # What was given up made the joint covariance larger, never smaller.
    assert np.linalg.slogdet(ekf.P)[1] >= np.linalg.slogdet(before)[1] - 1e-6


def test_a_correction_of_the_anchors_moves_the_sleepers_as_if_they_had_been_awake() -> None:
    rng = np.random.default_rng(2)
    ekf, _ = mapped(rng, 14)
    awake = ekf
    entries = [entry(i, anchor=i < 6) for i in range(14)]
    far = np.zeros(3), np.eye(3), np.zeros((3, 4)), np.diag([0.3, 0.3, 0.1]) ** 2, np.zeros(4)
    ekf.predict(*far)  # the robot has driven about since it saw the sleepers
    asleep = ekf.clone()
    group = put_to_sleep(asleep, entries[6:], entries[:6])
    asleep.keep(np.arange(6))
    before = ekf.landmarks()
    columns = state_entries(np.arange(6)).reshape(6, 2)  # somebody tells where the anchors are
    away = np.array([0.1, 0.05]) + rng.normal(0.0, 0.01, (6, 2))
    for each in (awake, asleep):
        each.update(
            columns, np.tile(np.eye(2), (6, 1, 1)), away, np.tile(1e-4 * np.eye(2), (6, 1, 1))
        )
    wake_up(asleep, group)
    assert np.hypot(*(awake.landmarks()[6:] - before[6:]).T).min() > 0.02
    assert asleep.landmarks() == pytest.approx(awake.landmarks(), abs=0.02)
    ratio = asleep.landmark_covs()[6:] / awake.landmark_covs()[6:]
    assert np.diagonal(ratio, axis1=1, axis2=2) == pytest.approx(1.0, abs=0.1)


def test_the_farthest_sleep_and_the_nearest_wake() -> None:
    rng = np.random.default_rng(3)
    ekf, _ = mapped(rng, 2)
    count = 90
    places = np.column_stack([np.linspace(0.2, 15.0, count), rng.uniform(-1, 1, count)])
    one = np.tile(1e-4 * np.eye(2), (count, 1, 1))
    ekf.keep(np.zeros(0, dtype=int))
    ekf.add(places, np.tile(np.eye(2, 3), (count, 1, 1)), np.tile(np.eye(2), (count, 1, 1)), one)
    entries, sleepers = [entry(i) for i in range(count)], Sleepers()
    gone = sleepers.put_away(ekf, entries, np.ones(count, dtype=bool), 40)
    assert 40 <= gone.sum() < 40 + GROUP and gone[-8:].mean() > 0.8 and not gone[:20].any()
    anchors = [i for i, known in enumerate(entries) if known.anchor]
    assert anchors and not gone[anchors].any()
    assert sum(len(group.entries) for group in sleepers.groups) == gone.sum()
    kept = np.flatnonzero(~gone)
    ekf.keep(kept)
    entries = [entries[i] for i in kept]
    for index, known in enumerate(entries):
        known.index = index
    assert sleepers.wake(ekf, entries, 100) == []  # all are too far
    everything, known = sleepers.whole(ekf, entries)
    assert everything.count == len(known) == count
    order = np.argsort(everything.landmarks()[:, 0])
    assert everything.landmarks()[order] == pytest.approx(places, abs=1e-9)
    ekf.x[0] = 15.0
    woken = sleepers.wake(ekf, entries, 100)
    assert woken and ekf.count == len(kept) + len(woken)
    assert ekf.landmarks()[len(kept) :, 0].mean() > 11.0


def test_groups_are_forgotten_with_their_anchors_or_when_born_too_late() -> None:
    ekf, _ = mapped(np.random.default_rng(4), 6)
    entries = [entry(i, anchor=i < 2, born_ns=i) for i in range(6)]
    sleepers = Sleepers([put_to_sleep(ekf, entries[2:4], entries[:2])])
    sleepers.groups.append(put_to_sleep(ekf, entries[4:], entries[:1]))
    sleepers.forget(entries, born_after_ns=4)
    assert len(sleepers.groups) == 1
    sleepers.forget(entries[1:], born_after_ns=4)
    assert not sleepers.groups
