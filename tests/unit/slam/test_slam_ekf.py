"""The sparse filter against filterpy's dense one, and its bookkeeping."""

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.geometry.se2 import SE2
from robot.slam.ekf import FIRST_LANDMARK, MARKER, POSE, LandmarkFilter
from robot.slam.motion import compose
from robot.slam.sensor import expected, expected_marker, locate, locate_marker, residual


def random_filter(seed: int, count: int) -> LandmarkFilter:
    """A filter of `count` landmarks in a random, fully correlated state."""
    rng = np.random.default_rng(seed)
    ekf = LandmarkFilter(np.full(FIRST_LANDMARK, 0.1))
    one = np.tile(np.eye(2), (count, 1, 1))
    ekf.add(rng.uniform(-4, 4, (count, 2)), np.zeros((count, 2, 3)), one, one)
    ekf.x[:FIRST_LANDMARK] = rng.normal(0, 0.5, FIRST_LANDMARK)
    root = rng.normal(0, 0.1, (ekf.dim_x, ekf.dim_x))
    ekf.P = root @ root.T / ekf.dim_x + 1e-4 * np.eye(ekf.dim_x)
    return ekf


def sights(
    ekf: LandmarkFilter, rng: np.random.Generator, m: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Columns, Jacobians, residuals and noise of `m` landmarks seen with errors."""
    which = rng.permutation(ekf.count)[:m]
    _, by_pose, by_point = expected(ekf.x[POSE], ekf.landmarks()[which])
    first = FIRST_LANDMARK + 2 * which[:, None]
    columns = np.hstack([np.tile(np.arange(3), (m, 1)), first, first + 1])
    root = rng.normal(0, 0.05, (m, 2, 2))
    noise = root @ root.transpose(0, 2, 1) + 1e-4 * np.eye(2)
    jacobian = np.concatenate([by_pose, by_point], axis=2)
    return columns, jacobian, rng.normal(0, 0.02, (m, 2)), noise


def dense_copy(ekf: LandmarkFilter, rows: int) -> ExtendedKalmanFilter:
    dense = ExtendedKalmanFilter(ekf.dim_x, rows)
    dense.x, dense.P = ekf.x.copy(), ekf.P.copy()
    return dense


@given(st.integers(0, 10_000), st.integers(1, 12), st.integers(1, 8))
@settings(max_examples=25, deadline=None)
def test_update_equals_filterpys_dense_one(seed: int, count: int, m: int) -> None:
    rng = np.random.default_rng(seed + 1)
    ekf = random_filter(seed, count)
    columns, jacobian, away, noise = sights(ekf, rng, min(m, count))
    m = len(columns)
    h, r = np.zeros((2 * m, ekf.dim_x)), np.zeros((2 * m, 2 * m))
    for i in range(m):
        h[2 * i : 2 * i + 2, columns[i]] = jacobian[i]
        r[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = noise[i]
    dense = dense_copy(ekf, 2 * m)
    dense.update(away.reshape(-1), lambda x: h, lambda x: np.zeros(2 * m), R=r)
    ekf.update(columns, jacobian, away, noise)
    assert np.abs(ekf.x - dense.x).max() < 1e-9
    assert np.abs(ekf.P - dense.P).max() < 1e-9
    assert np.array_equal(ekf.P, ekf.P.T)


@given(st.integers(0, 10_000), st.integers(0, 12))
@settings(max_examples=25, deadline=None)
def test_predict_equals_filterpys_dense_one(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed + 1)
    ekf = random_filter(seed, count)
    end, by_pose, by_increment = compose(ekf.x[POSE], SE2(*rng.normal(0, 0.1, 3).tolist()))
    by_calibration = by_increment @ rng.normal(0, 0.1, (3, 4))
    root = rng.normal(0, 0.01, (3, 3))
    dense = dense_copy(ekf, 2)
    dense.F[:3, :3], dense.F[:3, 3:7] = by_pose, by_calibration
    dense.Q = np.zeros_like(dense.P)
    dense.Q[:3, :3] = root @ root.T
    dense.Q[3:7, 3:7] = np.diag([1e-5, 1e-6, 1e-7, 0.0])
    dense.predict()
    ekf.predict(end, by_pose, by_calibration, root @ root.T, np.array([1e-5, 1e-6, 1e-7, 0.0]))
    assert np.abs(ekf.P - dense.P).max() < 1e-12
    assert np.array_equal(ekf.P, ekf.P.T)
    assert np.array_equal(ekf.x[POSE], end)


def test_filterpys_own_steps_still_work_after_growing() -> None:
    ekf = random_filter(3, 5)
    before = ekf.P.copy()
    ekf.prepare_dense()
    ExtendedKalmanFilter.predict(ekf)
    assert np.array_equal(ekf.P, before)
    h = np.eye(2, ekf.dim_x)
    ExtendedKalmanFilter.update(ekf, np.zeros(2), lambda x: h, lambda x: h @ x, R=np.eye(2))
    assert ekf.P[0, 0] < before[0, 0]


def test_adding_carries_the_poses_uncertainty_into_the_landmark() -> None:
    ekf = random_filter(5, 4)
    sight = np.array([[0.5, 0.3], [1.0, -0.4]])
    noise = np.array([np.diag([0.01, 0.001]), np.diag([0.02, 0.002])])
    points, by_pose, by_seen = locate(ekf.x[POSE], sight)
    n, before = ekf.dim_x, ekf.P.copy()
    ekf.add(points, by_pose, by_seen, noise)
    grow = np.zeros((n + 4, n + 4))
    grow[:n, :n] = np.eye(n)
    own = np.zeros((n + 4, n + 4))
    own[:n, :n] = before
    for i in range(2):
        rows = slice(n + 2 * i, n + 2 * i + 2)
        grow[rows, :3] = by_pose[i]
        grow[rows, rows] = by_seen[i]
        own[rows, rows] = noise[i]
    assert np.abs(ekf.P - grow @ own @ grow.T).max() < 1e-12
    assert ekf.count == 6 and ekf.landmarks()[4:] == pytest.approx(points)
    assert ekf.dim_x == len(ekf.x) == len(ekf.P)


def test_keeping_some_landmarks_marginalises_the_others() -> None:
    ekf = random_filter(6, 5)
    kept = np.array([0, 3])
    entries = FIRST_LANDMARK + np.r_[-FIRST_LANDMARK:0, 0, 1, 6, 7]
    wanted_x, wanted_p = ekf.x[entries], ekf.P[np.ix_(entries, entries)]
    ekf.keep(kept)
    assert ekf.count == 2
    assert np.array_equal(ekf.x, wanted_x) and np.array_equal(ekf.P, wanted_p)
    ekf.keep(np.zeros(0, dtype=int))
    assert ekf.count == 0 and ekf.dim_x == FIRST_LANDMARK


def test_marker_corrects_the_pose_in_all_three_directions() -> None:
    ekf = LandmarkFilter(np.array([1e-4] * 3 + [0.0] * 4 + [1.0] * 3))
    seen, tight = np.array([0.5, 0.1, 3.0]), np.diag([1e-6] * 3)
    ekf.place_marker(*locate_marker(ekf.x[POSE], seen), tight)
    ekf.inflate(np.diag([0.01, 0.01, 0.01]))
    ekf.x[POSE] = [0.05, -0.04, 0.03]
    for _ in range(3):  # three, as one linearised step leaves second-order terms
        predicted, jacobian = expected_marker(ekf.x[POSE], ekf.x[MARKER])
        columns = np.array([[0, 1, 2, 7, 8, 9]])
        away = residual(seen[None], predicted[None])
        ekf.update(columns, jacobian[None], away, tight[None])
    assert ekf.x[POSE] == pytest.approx(np.zeros(3), abs=2e-3)


@pytest.mark.parametrize(
    ("steps", "invariant"),
    [
        (3_000, False),
        (3_000, True),
        pytest.param(1_000_000, True, marks=[pytest.mark.long, pytest.mark.timeout(3600)]),
    ],
)
def test_covariance_stays_positive_definite_over_many_steps(steps: int, invariant: bool) -> None:
    rng = np.random.default_rng(7)
    ekf = random_filter(7, 25)
    ekf._invariant = invariant
    for k in range(steps):
        end, by_pose, _ = compose(ekf.x[POSE], SE2(0.02, 0.0, 0.05))
        noise = np.diag([1e-6, 1e-6, 1e-7])
        ekf.predict(end, by_pose, np.zeros((3, 4)), noise, np.array([1e-10, 0.0, 0.0, 0.0]))
        columns, jacobian, _, noise = sights(ekf, rng, 2)
        ekf.update(columns, jacobian, rng.normal(0, 0.01, (2, 2)), noise)
        if k % (steps // 6) == steps // 6 - 1:
            assert np.array_equal(ekf.P, ekf.P.T)
            np.linalg.cholesky(ekf.P)  # raises where it is not positive definite
    assert abs(ekf.x[2]) <= np.pi


def test_only_what_is_written_is_read() -> None:
    """The steps keep the upper half; whoever reads P finds both, and what was written stays."""
    ekf, whole = random_filter(8, 6), random_filter(8, 6)
    rng = np.random.default_rng(8)
    for k in range(40):
        end, by_pose, _ = compose(ekf.x[POSE], SE2(0.05, 0.01, 0.1))
        move = end, by_pose, np.full((3, 4), 0.01), 1e-5 * np.eye(3), np.full(4, 1e-8)
        step = sights(ekf, rng, 3)
        for each in (ekf, whole):
            each.predict(*move)
            each.update(*step)
            if k % 7 == 3:
                each.loosen(np.array([1, 4]), np.array([0.01, 0.02]))
                each.inflate(1e-4 * np.eye(3))
            if k % 11 == 5:
                each.keep(np.array([0, 1, 2, 3, 4, 5]))
            if k == 20:
                points, at_pose, at_sight = locate(each.x[POSE], np.array([[0.5, 0.2]]))
                each.add(points, at_pose, at_sight, 1e-4 * np.eye(2)[None])
        assert np.array_equal(whole.P, whole.P.T)  # read every time, the other at the end only
        assert np.array_equal(whole.head(), whole.P[:FIRST_LANDMARK, :FIRST_LANDMARK])
    assert np.array_equal(ekf.x, whole.x) and np.array_equal(ekf.P, whole.P)
    assert np.array_equal(ekf.pose_covs()[2], ekf.P[POSE, 14:16])
    assert np.array_equal(ekf.landmark_covs()[2], ekf.P[14:16, 14:16])


def test_a_clone_goes_its_own_way() -> None:
    ekf = random_filter(9, 3)
    twin, before = ekf.clone(), ekf.P.copy()
    twin.update(*sights(twin, np.random.default_rng(9), 2))
    assert np.array_equal(ekf.P, before) and not np.array_equal(twin.P, before)
    assert not np.array_equal(ekf.x, twin.x)


def test_invariant_update_is_the_plain_one_carried_to_the_new_positions() -> None:
    rng = np.random.default_rng(11)
    plain, turning = random_filter(11, 6), random_filter(11, 6)
    turning._invariant = True
    step = sights(plain, rng, 4)
    before = plain.x.copy()
    plain.update(*step)
    turning.update(*step)
    change = plain.x - before
    moved = turning.x - before
    assert moved == pytest.approx(change, abs=4.0 * abs(change[2]) * (abs(change[2]) + 0.05))
    carry = np.eye(plain.dim_x)
    for first in (POSE.start, MARKER.start, *range(FIRST_LANDMARK, plain.dim_x, 2)):
        carry[first, 2], carry[first + 1, 2] = -moved[first + 1], moved[first]
    assert np.abs(turning.P - carry @ plain.P @ carry.T).max() < 1e-12
    assert np.array_equal(turning.P, turning.P.T)


@pytest.mark.parametrize("invariant", [True, False])
def test_sights_teach_nothing_of_the_heading_that_the_start_did_not_tell(invariant: bool) -> None:
    rng = np.random.default_rng(12)
    sigma = np.array([0.1, 0.1, 0.1] + [0.0] * 4 + [1.0] * 3)
    ekf = LandmarkFilter(sigma, invariant)
    things = rng.uniform(-3.0, 3.0, (8, 2))
    true = np.array([0.2, -0.1, 0.15])  # the start is not where the filter believes
    noise = np.diag([0.05, 0.05]) ** 2
    seen, _, _ = expected(true, things)
    ekf.add(*locate(ekf.x[POSE], seen + rng.normal(0, 0.05, seen.shape)), np.tile(noise, (8, 1, 1)))
    motion = SE2(0.1, 0.0, 0.1)
    smallest = np.inf
    for _ in range(120):
        true, _, _ = compose(true, motion)
        end, by_pose, _ = compose(ekf.x[POSE], motion)
        ekf.predict(end, by_pose, np.zeros((3, 4)), np.diag([1e-5, 1e-5, 1e-5]), np.zeros(4))
        seen, _, _ = expected(true, things)
        predicted, at_pose, at_point = expected(ekf.x[POSE], ekf.landmarks())
        first = FIRST_LANDMARK + 2 * np.arange(8)[:, None]
        columns = np.hstack([np.tile(np.arange(3), (8, 1)), first, first + 1])
        away = residual(seen + rng.normal(0, 0.05, seen.shape), predicted)
        jacobian = np.concatenate([at_pose, at_point], axis=2)
        ekf.update(columns, jacobian, away, np.tile(noise, (8, 1, 1)))
        smallest = min(smallest, float(np.sqrt(ekf.P[2, 2])))
    assert (smallest >= 0.1 - 1e-6) == invariant
