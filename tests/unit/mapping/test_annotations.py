"""Drawings on the map: what they hold, what is refused, how they are saved and taken back."""

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.errors import MapError
from robot.mapping.annotations import Annotations, Area, Join, Line, RoomName
from robot.mapping.keepout import areas_mask, forbid
from robot.mapping.notes import MAX_UNDO, MapNotes
from robot.messages import Grid

SQUARE = Area("area 1", ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)))
coordinate = st.floats(-90.0, 90.0, allow_nan=False)
point = st.tuples(coordinate, coordinate)


def drawn():
    made = Annotations().add("no_go", SQUARE)
    made = made.add("walls", Line("wall 1", (2.0, 0.0), (2.0, 1.5)))
    made = made.add("cuts", Line("cut 1", (0.0, 0.0), (0.0, 2.0)))
    made = made.add("joins", Join("join 1", (0.0, 0.0), (3.0, 0.0)))
    made = made.add("zones", Area("rug", SQUARE.corners_m))
    return made.add("rooms", RoomName("kitchen", (0.5, 0.5)))


def empty_grid(cells=60, resolution_m=0.05):
    return Grid(resolution_m, -1.0, -1.0, np.zeros((cells, cells), np.int8))


def test_what_is_saved_comes_back_the_same():
    plain = json.loads(json.dumps(drawn().to_dict()))
    assert Annotations.from_dict(plain) == drawn()


@given(st.lists(point, min_size=3, max_size=8))
def test_any_polygon_is_refused_with_a_sentence_or_kept_exactly(corners):
    try:
        made = Annotations().add("no_go", Area("a", tuple(corners)))
    except MapError as error:
        assert str(error).endswith(".")
        return
    assert Annotations.from_dict(made.to_dict()) == made


@given(st.recursive(st.none() | st.booleans() | st.floats() | st.text(max_size=5),
                    lambda s: st.lists(s, max_size=3) | st.dictionaries(
                        st.sampled_from(["no_go", "walls", "name", "corners_m", "at_m", "rooms"]),
                        s, max_size=3), max_leaves=8))  # fmt: skip
def test_any_plain_value_is_read_or_refused(plain):
    try:
        Annotations.from_dict(plain)
    except MapError as error:
        assert str(error).startswith("map: ")


@pytest.mark.parametrize(
    ("kind", "mark", "says"),
    [
        ("no_go", Area("a", ((0, 0), (1, 0))), "2 corners"),
        ("no_go", Area("a", ((0, 0), (1, 0), (2, 0))), "encloses nothing"),
        ("no_go", Area("a", ((0, 0), (math.nan, 0), (2, 1))), "outside"),
        ("no_go", Area("a", ((0, 0), (1000, 0), (2, 1))), "outside"),
        ("zones", Area("a", ((0, 0), (1, 0), (2, 0))), "encloses nothing"),
        ("walls", Line("a", (0, 0), (0.01, 0)), "shorter"),
        ("rooms", RoomName("", (0, 0)), "letters"),
        ("rooms", RoomName("x" * 99, (0, 0)), "letters"),
        ("rooms", RoomName("a\nb", (0, 0)), "control"),
    ],
)
def test_what_makes_no_sense_is_refused_by_name(kind, mark, says):
    with pytest.raises(MapError, match=says):
        Annotations().add(kind, mark)


def test_names_are_unique_and_unknown_ones_are_told():
    with pytest.raises(MapError, match="exists already"):
        drawn().add("no_go", SQUARE)
    with pytest.raises(MapError, match="area 1"):
        drawn().remove("no_go", "area 7")
    assert drawn().remove("no_go", "area 1").no_go == ()
    assert drawn().free_name("no_go", "area") == "area 2"
    assert drawn().zone("Rug").name == "rug"
    with pytest.raises(MapError, match="there is: rug"):
        drawn().zone("carpet")


@given(point)
def test_the_distance_to_a_square_is_that_of_geometry(at):
    x, y = at
    made = Annotations().add("no_go", SQUARE)
    dx, dy = max(-x, 0.0, x - 1.0), max(-y, 0.0, y - 1.0)
    assert made.distance_m(x, y) == pytest.approx(math.hypot(dx, dy), abs=1e-9)


def test_a_mask_agrees_with_the_polygon_cell_by_cell():
    area = Area("a", ((-0.6, -0.5), (1.3, -0.2), (0.4, 0.3), (1.1, 1.4), (-0.7, 0.9)))
    grid = empty_grid()
    mask = areas_mask(grid, (area,))
    for row in range(0, 60, 3):
        for column in range(0, 60, 3):
            x, y = -1.0 + (column + 0.5) * 0.05, -1.0 + (row + 0.5) * 0.05
            assert mask[row, column] == area.holds(x, y)


def test_forbidden_cells_are_matter_with_a_margin_all_round():
    grid = empty_grid()
    annotations = Annotations((SQUARE,), (Line("w", (-0.8, -0.8), (1.8, -0.6)),))
    cells = forbid(grid, annotations, 0.1).cells
    for row in range(60):
        for column in range(60):
            x, y = -1.0 + (column + 0.5) * 0.05, -1.0 + (row + 0.5) * 0.05
            away_m = annotations.distance_m(x, y)
            if away_m <= 0.1 - 0.03:
                assert cells[row, column] == 100, (x, y)
            if away_m >= 0.1 + 0.08:
                assert cells[row, column] == 0, (x, y)
    assert (grid.cells == 0).all()  # the grid itself is not touched
    assert forbid(grid, Annotations(), 0.1) is grid


def test_changes_are_undone_one_by_one_and_snapshots_come_back():
    notes = MapNotes()
    notes.change(drawn())
    notes.keep("before the party")
    notes.change(Annotations())
    assert notes.version == 3
    notes.restore("before the party")
    assert notes.current == drawn()
    notes.undo()
    assert notes.current == Annotations()
    notes.undo()
    notes.undo()
    assert notes.current == Annotations()
    with pytest.raises(MapError, match="undone"):
        notes.undo()
    with pytest.raises(MapError, match="before the party"):
        notes.restore("after it")


def test_notes_are_saved_with_their_history():
    notes = MapNotes()
    for k in range(MAX_UNDO + 5):
        notes.change(Annotations().add("rooms", RoomName(f"room {k}", (0.0, float(k)))))
    notes.keep("all")
    again = MapNotes.from_dict(json.loads(json.dumps(notes.to_dict())))
    assert again.to_dict() == notes.to_dict() and again.current == notes.current
    for _ in range(MAX_UNDO):
        again.undo()
    with pytest.raises(MapError):
        again.undo()
    with pytest.raises(MapError, match=r"home\.npz: "):
        MapNotes.from_dict({"current": {"no_go": [{}]}}, "home.npz")
