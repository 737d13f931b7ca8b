"""Rooms: doors divide, furniture does not."""

import numpy as np
import pytest

from robot.mapping.rooms import segment_rooms
from robot.messages import Grid

RES = 0.05


def flat(*doors, legs=()):
    """Three rooms of 3 x 3 m side by side, walls 0.1 m; doors are (wall, y, width) in metres."""
    cells = np.full((62, 190), 100, np.int8)
    for x0 in (1, 64, 127):
        cells[1:61, x0 : x0 + 60] = 0
    for wall, y, width in doors:
        x0 = (61, 124)[wall]
        cells[int(y / RES) : int((y + width) / RES), x0 : x0 + 3] = 0
    for x, y in legs:
        cells[int(y / RES), int(x / RES)] = 100
    return Grid(RES, -1.0, 2.0, cells)


def test_doors_divide_three_rooms():
    rooms = segment_rooms(flat((0, 1.0, 0.85), (1, 2.0, 0.8)))
    assert len(np.unique(rooms[rooms > 0])) == 3
    for x0 in (1, 64, 127):
        inner = rooms[3:59, x0 + 2 : x0 + 58]
        assert len(np.unique(inner)) == 1, "a room has one number"
    assert len({int(rooms[30, x]) for x in (30, 90, 150)}) == 3


def test_a_wide_opening_joins_two_rooms():
    rooms = segment_rooms(flat((0, 0.2, 2.4), (1, 2.0, 0.8)))
    assert rooms[30, 30] == rooms[30, 90] != rooms[30, 150]
    assert rooms[30, 30] == 1, "the largest room is number one"


def test_table_legs_do_not_make_doors():
    legs = [(x, y) for x in (1.0, 1.7) for y in (1.0, 1.6)]
    rooms = segment_rooms(flat((0, 1.0, 0.85), (1, 2.0, 0.8), legs=legs))
    assert len(np.unique(rooms[rooms > 0])) == 3


def test_every_free_cell_and_no_other_has_a_room():
    grid = flat((0, 1.0, 0.85))
    rooms = segment_rooms(grid)
    assert np.array_equal(rooms > 0, grid.cells == 0)
    assert rooms.dtype == np.int32


@pytest.mark.parametrize("value", [-1, 100])
def test_a_map_without_floor_has_no_rooms(value):
    assert segment_rooms(Grid(RES, 0.0, 0.0, np.full((5, 7), value, np.int8))).sum() == 0
