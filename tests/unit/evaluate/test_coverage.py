"""Swept floor by hand: a bar along a line, a turn, a jump, and growing bit by bit."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.evaluate.coverage import Sweep, area_m2, path_ratio, swept_mask

CELL_M, BRUSH_M = 0.02, 0.2


def floor(width_m=2.0, height_m=1.0):
    shape = (round(height_m / CELL_M), round(width_m / CELL_M))
    return SimpleNamespace(
        resolution_m=CELL_M, origin_x_m=-0.5, origin_y_m=0.25, floor=np.ones(shape, bool)
    )


def line(x0, y0, x1, y1, steps=200):
    t = np.linspace(0.0, 1.0, steps)
    yaw = np.full(steps, np.arctan2(y1 - y0, x1 - x0))
    return np.column_stack([t, x0 + t * (x1 - x0), y0 + t * (y1 - y0), yaw])


def test_a_straight_drive_sweeps_length_times_width():
    track = line(-0.2, 0.75, 1.2, 0.75)
    swept_m2 = np.count_nonzero(swept_mask(floor(), track, BRUSH_M)) * CELL_M**2
    assert swept_m2 == pytest.approx(1.4 * BRUSH_M, rel=0.03)
    assert path_ratio(floor(), track, BRUSH_M) == pytest.approx(1.4 * BRUSH_M / 2.0)
    assert area_m2(floor()) == pytest.approx(2.0)


def test_the_share_of_a_floor_and_none_of_an_empty_one():
    sweep = Sweep(floor(), BRUSH_M)
    assert sweep.covered_pct() == 0.0
    sweep.add(line(-0.5, 0.75, 1.5, 0.75))
    assert sweep.covered_pct() == pytest.approx(100.0 * BRUSH_M / 1.0, abs=1.0)
    nothing = floor()
    nothing.floor[:] = False
    assert np.isnan(Sweep(nothing, BRUSH_M).covered_pct())


def test_a_turn_on_the_spot_sweeps_a_disc_and_a_jump_sweeps_nothing():
    yaw = np.linspace(0.0, np.pi, 80)
    turn = np.column_stack([yaw, np.full(80, 0.5), np.full(80, 0.75), yaw])
    disc_m2 = np.count_nonzero(swept_mask(floor(), turn, BRUSH_M)) * CELL_M**2
    assert disc_m2 == pytest.approx(np.pi * (BRUSH_M / 2.0) ** 2, rel=0.06)
    jump = np.array([[0.0, -0.3, 0.75, 0.0], [1.0, 1.3, 0.75, 0.0]])
    assert not swept_mask(floor(), jump, BRUSH_M).any()
    assert not swept_mask(floor(), np.full((5, 4), np.nan), BRUSH_M).any()


@settings(max_examples=25, deadline=None)
@given(st.lists(st.integers(1, 60), min_size=1, max_size=6), st.integers(0, 2**31))
def test_bit_by_bit_is_the_same_as_all_at_once(cuts, seed):
    rng = np.random.default_rng(seed)
    steps = rng.normal(0.0, 0.02, (150, 2)).cumsum(axis=0) + (0.5, 0.75)
    track = np.column_stack([np.arange(150.0), steps, rng.uniform(-3.0, 3.0, 150)])
    sweep = Sweep(floor(), BRUSH_M)
    begin = 0
    for cut in [*np.cumsum(cuts).tolist(), len(track)]:
        sweep.add(track[begin:cut])
        begin = max(begin, cut)
    whole = swept_mask(floor(), track, BRUSH_M)
    assert np.count_nonzero(sweep.mask() ^ whole) <= 0.02 * np.count_nonzero(whole) + 4
