"""How far matter is: from cells that are full, and from cells in which a face stands."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.planning.costmap import distance_m, face_distance_m

CELL_M = 0.025


def wall(percent):
    """Matter from column 20 on, its first column filled in part."""
    filled = np.zeros((30, 40), np.int8)
    filled[:, 20], filled[:, 21:] = percent, 100
    return filled


@pytest.mark.parametrize("percent", [1, 20, 49, 50, 80, 100])
def test_a_face_stands_where_the_filling_says(percent):
    found = face_distance_m(wall(percent), CELL_M)[15]
    face = 21.0 - percent / 100.0
    x = np.arange(20)
    assert found[:20] == pytest.approx((face - x - 0.5) * CELL_M, abs=1e-6)


@given(st.lists(st.tuples(st.integers(0, 39), st.integers(0, 29)), max_size=8))
def test_full_cells_are_as_far_as_their_edges(places):
    filled = np.zeros((30, 40), np.int8)
    for x, y in places:
        filled[y, x] = 100
    assert np.array_equal(face_distance_m(filled, CELL_M), distance_m(filled > 0, CELL_M))


def test_without_matter_it_is_far():
    assert face_distance_m(np.zeros((5, 6), np.int8), CELL_M).min() > 100.0
