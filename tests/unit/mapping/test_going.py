"""Floor that is hard to cross is learned by driving, bounded to where it was, and forgotten."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from robot.config import MappingConfig
from robot.geometry.se2 import SE2
from robot.mapping.going import LEAST_PCT
from robot.mapping.grid import OccupancyGrid

RADIUS_M = 0.1


def driven(*lost, at=None):
    grid = OccupancyGrid(MappingConfig())
    grid.clear_footprint(SE2(), 1.0)
    for share in lost:
        grid.feel(at or SE2(), RADIUS_M, share)
    return grid


def hard_m2(grid):
    view = grid.snapshot()
    return np.count_nonzero(grid.lost_pct(view)) * view.resolution_m**2


def test_a_carpet_is_hard_where_the_wheels_were_and_nowhere_else():
    grid = driven(0.6, 0.6, 0.6, at=SE2(0.5, -0.3))
    view = grid.snapshot()
    lost = grid.lost_pct(view)
    assert lost.shape == view.cells.shape and 50 < lost.max() <= 60
    ys, xs = np.nonzero(lost)
    x = view.origin_x_m + (xs + 0.5) * view.resolution_m
    y = view.origin_y_m + (ys + 0.5) * view.resolution_m
    assert np.hypot(x - 0.5, y + 0.3).max() <= RADIUS_M
    assert abs(hard_m2(grid) - np.pi * RADIUS_M**2) < 0.01


def test_what_wheels_lose_on_any_floor_is_nothing():
    assert hard_m2(driven(0.05, 0.2, 0.25)) == 0.0


def test_one_slip_is_not_the_floor_but_wheels_that_were_held_are():
    assert hard_m2(driven(0.5)) == 0.0
    assert hard_m2(driven(1.0)) > 0.0


def test_a_carpet_that_is_gone_is_forgotten():
    assert hard_m2(driven(0.8, 0.8, 0.8, 0.0, 0.0)) == 0.0


@given(st.lists(st.floats(0.0, 1.0), max_size=8))
def test_it_is_kept_over_night_and_stays_where_it_is_as_the_map_grows(lost):
    grid = driven(*lost, at=SE2(-0.4, 0.2))
    again = OccupancyGrid(MappingConfig())
    again.restore(grid.memory())
    again.clear_footprint(SE2(-3.0, -2.0), 0.3)  # the map grows
    view = again.snapshot()
    kept = again.lost_pct(view)
    assert np.count_nonzero(kept) == np.count_nonzero(grid.lost_pct(grid.snapshot()))
    assert kept.max(initial=0) == 0 or kept.max() >= LEAST_PCT
    ys, xs = np.nonzero(kept)
    assert (np.abs((xs + 0.5) * view.resolution_m + view.origin_x_m + 0.4) <= RADIUS_M).all()
    assert (np.abs((ys + 0.5) * view.resolution_m + view.origin_y_m - 0.2) <= RADIUS_M).all()
