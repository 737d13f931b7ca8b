"""The swept floor: area of straight and turning tracks, alignment with the grid."""

import math

import numpy as np
import pytest

from robot.config import MappingConfig
from robot.geometry.se2 import SE2
from robot.mapping.swept import SweptFloor
from robot.messages import Grid


def drive(swept, length_m, yaw_rad, start=(0.0, 0.0), step_m=0.005):
    for d in np.arange(0.0, length_m + 1e-9, step_m):
        swept.sweep(
            SE2(start[0] + d * math.cos(yaw_rad), start[1] + d * math.sin(yaw_rad), yaw_rad)
        )


@pytest.mark.parametrize("yaw_rad", [0.0, 0.3, math.pi / 4, 2.0, -3.0])
def test_a_straight_track_sweeps_its_length_times_the_brush(yaw_rad):
    areas = []
    for offset in (0.0, 0.007, 0.016):
        swept = SweptFloor(MappingConfig(), 0.20)
        drive(swept, 2.0, yaw_rad, (offset, offset / 2))
        areas.append(swept.area_m2)
    assert np.mean(areas) == pytest.approx(0.40, rel=0.04)


def test_a_turn_on_the_spot_sweeps_a_disc():
    swept = SweptFloor(MappingConfig(), 0.20)
    for yaw in np.arange(0.0, 3.3, 0.02):
        swept.sweep(SE2(1.0, 1.0, yaw))
    assert swept.area_m2 == pytest.approx(math.pi * 0.01, rel=0.15)


def test_the_bar_sweeps_nothing_ahead_of_the_axle():
    swept = SweptFloor(MappingConfig(), 0.20)
    drive(swept, 1.0, 0.0)
    grid = Grid(0.025, -1.0, -1.0, np.zeros((80, 100), np.int8))
    mask = swept.on(grid)
    columns = np.flatnonzero(mask.any(axis=0)) * 0.025 - 1.0
    assert columns.max() <= 1.0 + 0.026 and columns.min() >= -0.051


def test_the_mask_lies_on_the_grid_wherever_that_begins():
    swept = SweptFloor(MappingConfig(), 0.20)
    drive(swept, 1.0, 0.0, (-3.0, 5.0))
    whole = swept.on(Grid(0.025, -6.0, 2.0, np.zeros((240, 240), np.int8)))
    part = swept.on(Grid(0.025, -2.75, 4.75, np.zeros((10, 20), np.int8)))
    assert np.array_equal(whole[110:120, 130:150], part)
    assert part.any() and part.dtype == bool
    assert swept.on(Grid(0.025, 8.0, 8.0, np.zeros((4, 4), np.int8))).sum() == 0


def test_a_lifted_brush_and_a_jump_sweep_nothing_between():
    for lift in (True, False):
        swept = SweptFloor(MappingConfig(), 0.20)
        drive(swept, 0.5, 0.0)
        if lift:
            swept.lift()
        drive(swept, 0.5, 0.0, (3.0, 0.0))
        assert swept.area_m2 == pytest.approx(0.20, rel=0.12)


def test_a_pose_that_is_no_number_is_left_out():
    swept = SweptFloor(MappingConfig(), 0.20)
    swept.sweep(SE2(math.nan, 0.0, 0.0))
    assert swept.area_m2 == 0.0


def test_a_grid_with_other_cells_is_refused():
    with pytest.raises(ValueError, match="cells of"):
        SweptFloor(MappingConfig(), 0.20).on(Grid(0.05, 0.0, 0.0, np.zeros((4, 4), np.int8)))
