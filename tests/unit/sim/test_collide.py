"""Distances to outlines, against the definition."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from robot.sim.collide import clearance_m, inside, nearest

SQUARE = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]])
WALLS = np.hstack([SQUARE, np.roll(SQUARE, -1, axis=0)])
coordinate = st.floats(-4.0, 4.0)


def truth(x, y):
    """Distance to the rectangle's rim."""
    dx, dy = max(-x, x - 2.0, 0.0), max(-y, y - 1.0, 0.0)
    return math.hypot(dx, dy) or min(x, 2.0 - x, y, 1.0 - y)


@given(coordinate, coordinate)
def test_the_nearest_wall_is_as_far_as_geometry_says(x, y):
    distance, nx, ny = nearest(WALLS, x, y, 100.0)
    assert math.isclose(distance, truth(x, y), abs_tol=1e-6)
    if distance > 1e-3:
        assert math.isclose(math.hypot(nx, ny), 1.0, rel_tol=1e-6)
        touched = truth(x - distance * nx, y - distance * ny)
        assert touched < 1e-5


@given(coordinate, coordinate)
def test_beyond_reach_nothing_is_near(x, y):
    reach = 0.3
    assert (nearest(WALLS, x, y, reach)[0] < reach) == (truth(x, y) < reach)


@given(coordinate, coordinate)
def test_inside_is_inside(x, y):
    if min(abs(x), abs(x - 2), abs(y), abs(y - 1)) > 1e-9:
        assert inside(SQUARE, x, y) == (0 < x < 2 and 0 < y < 1)


def test_the_raster_agrees_with_single_distances():
    clearance = clearance_m(WALLS, -1.0, -1.0, 0.05, (60, 80), 0.4)
    for row in range(0, 60, 7):
        for column in range(0, 80, 7):
            expected = truth(-1.0 + (column + 0.5) * 0.05, -1.0 + (row + 0.5) * 0.05)
            if expected < 0.4:
                assert math.isclose(clearance[row, column], expected, abs_tol=1e-9)
            else:
                assert clearance[row, column] >= 0.4
