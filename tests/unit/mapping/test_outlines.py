"""Outlines of rooms: where the room is, few corners, nothing for no room."""

import numpy as np
import pytest

from robot.mapping.annotations import Area
from robot.mapping.named_rooms import Rooms
from robot.mapping.outlines import MAX_CORNERS, outline_m
from robot.messages import Grid


def rooms_of(labels):
    grid = Grid(0.05, -1.0, -2.0, np.zeros(labels.shape, np.int8))
    return Rooms(grid, labels, ("one", "two"))


def test_a_rectangle_has_four_corners_in_its_place():
    labels = np.zeros((60, 80), np.int32)
    labels[10:30, 20:60] = 1
    corners = outline_m(rooms_of(labels), 1)
    assert sorted(corners) == sorted(
        [(0.025, -1.475), (1.975, -1.475), (1.975, -0.525), (0.025, -0.525)]
    )


def test_a_ragged_room_keeps_few_corners_and_its_floor():
    rng = np.random.default_rng(3)
    rows, columns = np.mgrid[:200, :200]
    angle = np.arctan2(rows - 100, columns - 100)
    radius = 60 + 15 * np.sin(9 * angle) + rng.uniform(-4, 4, (200, 200))
    labels = (np.hypot(rows - 100, columns - 100) < radius).astype(np.int32)
    corners = outline_m(rooms_of(labels), 1)
    assert 4 <= len(corners) <= MAX_CORNERS
    area = Area("one", tuple(corners))
    inside = [
        area.holds(-1.0 + (c + 0.5) * 0.05, -2.0 + (r + 0.5) * 0.05)
        for r, c in zip(rows[labels > 0][::50], columns[labels > 0][::50], strict=True)
    ]
    assert np.mean(inside) == pytest.approx(1.0, abs=0.08)


def test_of_two_pieces_the_larger_and_of_nothing_nothing():
    labels = np.zeros((40, 40), np.int32)
    labels[2:5, 2:5] = 1
    labels[10:30, 10:30] = 1
    xs = [x for x, _ in outline_m(rooms_of(labels), 1)]
    assert min(xs) == pytest.approx(-1.0 + 10.5 * 0.05)
    assert outline_m(rooms_of(labels), 2) == []
