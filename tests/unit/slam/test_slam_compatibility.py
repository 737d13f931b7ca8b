"""Joint compatibility: correlations decide where the nearest neighbour is wrong."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.slam.survey.compatibility import PairTable, chi2_99, joint_compatibility


def table(
    sights: np.ndarray, landmarks: np.ndarray, shift_sigma: float, noise_sigma: float
) -> PairTable:
    """Sights and landmarks on a plane, all landmarks shifted together by an unknown amount."""
    sight, landmark = (index.reshape(-1) for index in np.indices((len(sights), len(landmarks))))
    away = sights[sight] - landmarks[landmark]
    p = len(sight)
    shared = np.tile(shift_sigma**2 * np.eye(2), (p, p))
    noise = np.tile(noise_sigma**2 * np.eye(2), (p, 1, 1))
    near = np.sum(away**2, axis=1) / (shift_sigma**2 + noise_sigma**2) < chi2_99(2)
    rows = np.repeat(near, 2)
    return PairTable(
        sight[near], landmark[near], away[near], shared[np.ix_(rows, rows)], noise[near]
    )


def believed(pairs: PairTable, margin: float = 1.0) -> dict[int, int]:
    chosen = joint_compatibility(pairs, margin)
    return {int(pairs.sight[k]): int(pairs.landmark[k]) for k in chosen}


def test_chi2_quantiles() -> None:
    for dof, value in ((2, 9.21), (4, 13.28), (6, 16.81), (20, 37.57)):
        assert chi2_99(dof) == pytest.approx(value, rel=0.01)


def test_a_common_shift_misleads_the_nearest_neighbour_but_not_the_joint_test() -> None:
    landmarks = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.2, 0.9]])
    seen = landmarks[[0, 1, 3]] + (0.7, 0.0)  # each of the first two is nearer to the wrong one
    nearest = np.argmin(np.abs(seen[:, None] - landmarks[None]).sum(axis=2), axis=1)
    assert nearest.tolist() != [0, 1, 3]
    assert believed(table(seen, landmarks, 0.6, 0.05)) == {0: 0, 1: 1, 2: 3}


def test_what_could_as_well_be_another_is_not_believed() -> None:
    landmarks = np.array([[0.0, 0.0], [0.3, 0.0]])
    seen = np.array([[0.15, 0.0]])
    assert believed(table(seen, landmarks, 0.5, 0.05)) == {}
    assert believed(table(np.array([[0.0, 0.0]]), landmarks, 0.02, 0.02)) == {0: 0}


def test_a_group_that_looks_like_another_is_not_believed_until_one_more_thing_tells() -> None:
    group = np.array([[0.0, 0.0], [0.3, 0.0], [0.0, 0.2]])
    landmarks = np.vstack([group, group + (1.0, 0.0), [[0.2, 1.0]]])
    between = (0.48, 0.0)  # a little nearer to the first, but that is the common shift
    assert believed(table(group + between, landmarks, 0.6, 0.05)) == {}
    seen = np.vstack([group, [[0.2, 1.0]]]) + between
    assert believed(table(seen, landmarks, 0.6, 0.05)) == {0: 0, 1: 1, 2: 2, 3: 6}


def test_no_pairs() -> None:
    assert believed(table(np.array([[50.0, 0.0]]), np.zeros((1, 2)), 0.1, 0.1)) == {}


@given(st.integers(0, 10_000))
@settings(max_examples=30, deadline=None)
def test_finds_as_many_pairs_as_trying_everything(seed: int) -> None:
    rng = np.random.default_rng(seed)
    landmarks = rng.uniform(0, 3, (4, 2))
    seen = landmarks[rng.permutation(4)[:3]] + rng.normal(0, 0.3, 2) + rng.normal(0, 0.05, (3, 2))
    pairs = table(seen, landmarks, 0.3, 0.05)
    most = 0
    for size in range(1, 4):
        for subset in itertools.combinations(range(len(pairs.sight)), size):
            index = np.array(subset)
            one_each = len(set(pairs.sight[index])) == len(set(pairs.landmark[index])) == size
            if one_each and pairs.distance(list(subset))[0] < chi2_99(2 * size):
                most = size
    assert len(joint_compatibility(pairs, -np.inf)) == most
