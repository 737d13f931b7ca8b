"""Rooms for people: cut, joined and named at places, whatever numbers they had."""

import numpy as np
import pytest

from robot.errors import MapError
from robot.mapping.annotations import Annotations, Join, Line, RoomName
from robot.mapping.named_rooms import make_rooms, room_at, splits
from robot.mapping.rooms import segment_rooms
from robot.messages import Grid

RES = 0.05


def two_rooms(shift=0):
    """3 m by 3 m and 2 m by 3 m, a door of 0.8 m between them; `shift` cells more floor unseen."""
    cells = np.full((66, 108 + shift), -1, np.int8)
    cells[1:65, 1 + shift : 107 + shift] = 100
    cells[2:62, 2 + shift : 62 + shift] = 0
    cells[2:62, 64 + shift : 104 + shift] = 0
    cells[24:40, 62 + shift : 64 + shift] = 0
    return Grid(RES, -shift * RES, 0.0, cells)


def rooms_of(grid, annotations=None):
    return make_rooms(grid, segment_rooms(grid), annotations or Annotations())


def test_rooms_are_numbered_by_area():
    rooms = rooms_of(two_rooms())
    assert rooms.names == ("room 1", "room 2")
    assert rooms.area_m2(1) == pytest.approx(9.0, abs=0.3)
    assert rooms.area_m2(2) == pytest.approx(6.0, abs=0.3)


def test_a_name_stays_with_its_place_when_the_map_grows():
    named = Annotations(rooms=(RoomName("Kitchen", (4.0, 1.0)),))
    for shift in (0, 13):
        rooms = rooms_of(two_rooms(shift), named)
        assert rooms.names == ("room 1", "Kitchen")
        assert rooms.number("kitchen") == 2
    with pytest.raises(MapError, match="Kitchen"):
        rooms.number("cellar")


def test_a_cut_divides_a_room_and_a_line_in_the_air_does_not():
    grid = two_rooms()
    cut = Annotations(cuts=(Line("cut 1", (0.0, 1.2), (3.2, 1.2)),))
    rooms = rooms_of(grid, cut)
    assert len(rooms.names) == 3
    assert sum(rooms.area_m2(i) for i in (1, 2, 3)) == pytest.approx(15.0, abs=0.3)
    found = segment_rooms(grid)
    assert splits(grid, found, (0.0, 1.2), (3.2, 1.2))
    assert not splits(grid, found, (1.0, 1.2), (2.0, 1.2))


def test_joined_rooms_are_one():
    joined = Annotations(joins=(Join("join 1", (1.0, 1.0), (4.0, 1.0)),))
    rooms = rooms_of(two_rooms(), joined)
    assert rooms.names == ("room 1",) and rooms.area_m2(1) > 14.5


def test_the_middle_of_a_room_lies_in_it():
    rooms = rooms_of(two_rooms())
    for number in (1, 2):
        assert room_at(rooms.grid, rooms.labels, rooms.middle_m(number)) == number
    assert room_at(rooms.grid, rooms.labels, (50.0, 50.0)) == 0


@pytest.mark.parametrize("shift", [0, 7])
@pytest.mark.parametrize("smaller", [False, True])
def test_rooms_are_laid_on_another_grid_of_the_lattice(shift, smaller):
    rooms = rooms_of(two_rooms())
    other = two_rooms(shift)
    if smaller:
        other = Grid(RES, other.origin_x_m + 5 * RES, 6 * RES, other.cells[6:50, 5:90].copy())
    mask = rooms.on(other, (2,))
    xs = np.nonzero(mask)[1]
    x_m = other.origin_x_m + (xs + 0.5) * RES
    assert x_m.min() > 3.0 and mask.any()
    for row, column in ((30, 70 + shift), (30, 10 + shift)):
        if not smaller:
            assert mask[row, column] == (column - shift > 63)


def test_floor_seen_through_a_gap_is_no_room():
    grid = two_rooms()
    grid.cells[63:64, 80:83] = 0  # beyond the wall
    assert rooms_of(grid).names == ("room 1", "room 2")
