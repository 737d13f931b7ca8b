"""Distances to outlines, against the definition."""

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.sim.collide import clearance_m, inside, march, nearest

SQUARE = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]])
WALLS = np.hstack([SQUARE, np.roll(SQUARE, -1, axis=0)])
coordinate = st.floats(-4.0, 4.0)
compiling = settings(deadline=None)  # the first call may


def truth(x, y):
    """Distance to the rectangle's rim."""
    dx, dy = max(-x, x - 2.0, 0.0), max(-y, y - 1.0, 0.0)
    return math.hypot(dx, dy) or min(x, 2.0 - x, y, 1.0 - y)


@compiling
@given(coordinate, coordinate)
def test_the_nearest_wall_is_as_far_as_geometry_says(x, y):
    distance, nx, ny = nearest(WALLS, x, y, 100.0)
    assert math.isclose(distance, truth(x, y), abs_tol=1e-6)
    if distance > 1e-3:
        assert math.isclose(math.hypot(nx, ny), 1.0, rel_tol=1e-6)
        touched = truth(x - distance * nx, y - distance * ny)
        assert touched < 1e-5


@compiling
@given(coordinate, coordinate)
def test_beyond_reach_nothing_is_near(x, y):
    reach = 0.3
    assert (nearest(WALLS, x, y, reach)[0] < reach) == (truth(x, y) < reach)


@compiling
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


@compiling
@given(st.floats(0.05, 1.95), st.floats(0.05, 0.95), st.floats(-3.1, 3.1))
def test_a_ray_ends_at_the_wall(x, y, angle):
    cell = 0.01
    rows, columns = np.mgrid[0:120, 0:220]  # the square, with 0.1 m of matter around
    px, py = (columns + 0.5) * cell - 0.1, (rows + 0.5) * cell - 0.1
    far = np.maximum(np.minimum.reduce([px, 2.0 - px, py, 1.0 - py]) - 0.5 * cell, 0.0)
    reach = march(far, cell, -0.1, -0.1, x, y, np.array([angle, -angle]))
    for sign, got in zip((1.0, -1.0), reach, strict=True):
        c, s = math.cos(angle), math.sin(sign * angle)
        to_x = math.inf if abs(c) < 1e-9 else ((2.0 if c > 0 else 0.0) - x) / c
        to_y = math.inf if abs(s) < 1e-9 else ((1.0 if s > 0 else 0.0) - y) / s
        wall = min(to_x, to_y)
        end = x + got * c, y + got * s
        assert truth(*end) < 0.03 and got < wall + 0.03
