"""NEES, quantiles, the association tally and the best share of a track."""

import numpy as np
import pytest

from robot.evaluate.consistency import AssociationTally, best_share_rmse_m, chi2_quantile, nees
from robot.geometry.se2 import SE2


def test_chi2_quantiles() -> None:
    assert chi2_quantile(3, 0.95) == pytest.approx(7.815, rel=0.01)
    assert chi2_quantile(30, 0.95) == pytest.approx(43.77, rel=0.002)


def test_nees_of_honest_errors_is_the_number_of_dimensions_in_any_frame() -> None:
    rng = np.random.default_rng(1)
    n = 4000
    root = np.array([[0.3, 0.0, 0.0], [0.1, 0.05, 0.0], [0.02, 0.01, 0.03]])
    cov = root @ root.T
    truth = np.column_stack([np.arange(n), rng.uniform(-5, 5, (n, 2)), rng.uniform(-3, 3, n)])
    estimate = truth.copy()
    estimate[:, 1:] += rng.normal(size=(n, 3)) @ root.T
    covs = np.tile(cov, (n, 1, 1))
    here = nees(estimate, covs, truth, SE2())
    assert here.mean() == pytest.approx(3.0, rel=0.06)
    assert (here <= chi2_quantile(3, 0.95)).mean() == pytest.approx(0.95, abs=0.015)
    turn = SE2(1.0, -2.0, 2.5)
    moved = truth.copy()
    moved[:, 1:3] = turn.apply(truth[:, 1:3])
    moved[:, 3] += turn.yaw_rad
    assert nees(estimate, covs, moved, turn) == pytest.approx(here)
    assert nees(estimate, 0.25 * covs, truth, SE2()).mean() == pytest.approx(12.0, rel=0.06)


def test_tally_names_landmarks_by_their_most_frequent_thing() -> None:
    tally = AssociationTally()
    assert tally.wrong_pct() is None and tally.thing(0) is None
    tally.count([0, 1, -1], [6, 7, 8])
    tally.count([0, 0, 1], [6, 9, 7])
    assert tally.thing(0) == 6 and tally.thing(1) == 7 and tally.thing(-1) is None
    assert tally.wrong_pct() == pytest.approx(20.0)


def test_best_share_ignores_the_jumps_of_the_truth() -> None:
    rng = np.random.default_rng(2)
    truth = rng.uniform(-50, 50, (200, 2))
    estimate = SE2(3.0, 4.0, 1.0).apply(truth) + rng.normal(0, 0.1, (200, 2))
    assert best_share_rmse_m(estimate, truth) < 0.15
    truth[:15] += 30.0
    assert best_share_rmse_m(estimate, truth) == pytest.approx(0.14, abs=0.03)
    assert best_share_rmse_m(estimate, truth, 1.0) > 5.0
