"""Faces of things, finer than the grid's cells."""

import math

import numpy as np
import pytest

from robot.config import MappingConfig
from robot.geometry.se2 import SE2
from robot.mapping.fronts import Fronts
from robot.mapping.grid import OccupancyGrid
from robot.mapping.raster import Window
from robot.messages import Scan

RES_M = 0.025
BEARINGS = np.linspace(-0.6, 0.6, 120)
EYE_M = (0.13, 0.03)


def face_m(cells, column):
    """Where the face stands in a row of percents, from the first cell that is filled in part."""
    k = int(np.flatnonzero(cells > 0)[0])
    return (column + k + 1 - cells[k] / 100.0) * RES_M


def scan_of_wall(pose, x_m, rng):
    """A scan of a wall at `x_m`, with the noise of stereo."""
    eye = pose @ SE2(*EYE_M)
    true = (x_m - eye.x_m) / np.cos(pose.yaw_rad + BEARINGS)
    seen = true + rng.normal(0.0, 0.022, len(true)) * true**2
    x, y = EYE_M[0] + seen * np.cos(BEARINGS), EYE_M[1] + seen * np.sin(BEARINGS)
    return Scan(np.arctan2(y, x), np.hypot(x, y), np.hypot(x, y))


@pytest.mark.parametrize("x_wall", [0.9, 0.906, 0.912, 0.918, 0.924])
@pytest.mark.parametrize("yaw", [0.0, 0.6])
def test_a_wall_is_known_to_a_few_millimetres(x_wall, yaw):
    grid, rng = OccupancyGrid(MappingConfig(), EYE_M), np.random.default_rng(3)
    for step in range(20):
        pose = SE2(0.01 * step, -0.01 * step, yaw)
        grid.integrate(pose, scan_of_wall(pose, x_wall, rng))
    view = grid.snapshot()
    column = round(view.origin_x_m / RES_M)
    rows = [round((y - view.origin_y_m) / RES_M) for y in (0.1, 0.2, 0.3)]
    faces = [face_m(np.maximum(view.cells[row], 0), column) for row in rows]
    assert faces == pytest.approx([x_wall] * 3, abs=0.008)


def test_what_was_touched_is_known_exactly():
    fronts = Fronts(RES_M)
    fronts.follow(Window(0, 0, 40, 40))
    fronts.touch(np.array([[0.505, 0.31], [0.505, 0.33]]), np.array([1.0, 0.0]))
    occupied = np.zeros((40, 40), bool)
    occupied[12:14, 20] = True
    filled = fronts.filled(occupied)
    assert filled[12:14, 20] == pytest.approx(80.0, abs=0.01)  # from 0.505 to 0.525
    assert np.count_nonzero(filled) == 2


def test_free_cells_are_filled_in_part_only_beside_matter():
    fronts = Fronts(RES_M)
    fronts.follow(Window(0, 0, 40, 40))
    fronts.touch(np.array([[0.52, 0.31]]), np.array([1.0, 0.0]))
    occupied = np.zeros((40, 40), bool)
    assert not fronts.filled(occupied).any()  # a door that was opened
    occupied[12, 21] = True
    assert fronts.filled(occupied)[12, 20] == pytest.approx(20.0, abs=0.01)
    assert fronts.filled(occupied)[12, 21] == 100.0


def test_a_thing_that_moved_is_learnt_anew():
    fronts, angle = Fronts(RES_M), np.linspace(-0.1, 0.1, 9)
    fronts.follow(Window(0, -10, 40, 10))
    occupied = np.zeros((20, 40), bool)
    occupied[10, 20] = True
    for x_m in (0.51, 0.502):
        for _ in range(100):
            fronts.add(SE2(0.1, 0.001), np.stack([np.full(9, x_m - 0.1), 0.4 * np.tan(angle)], 1))
    assert fronts.filled(occupied)[10, 20] == pytest.approx(100.0 * (0.525 - 0.502) / RES_M, abs=3)


def test_lone_rays_and_rays_without_an_end_teach_nothing():
    fronts = Fronts(RES_M)
    fronts.follow(Window(0, 0, 40, 40))
    ends = np.full((5, 2), math.nan)
    ends[2] = 0.5, 0.3
    fronts.add(SE2(), ends)
    fronts.add(SE2(), np.array([[0.5, 0.3]]))
    occupied = np.ones((40, 40), bool)
    assert (fronts.filled(occupied) == 100.0).all()
