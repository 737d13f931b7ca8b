"""The order of work: never longer than before, everything visited once, ends turned to fit."""

from __future__ import annotations

import itertools
import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.config import PlanningConfig, RobotConfig
from robot.geometry.se2 import SE2
from robot.messages import Grid
from robot.planning.costmap import build_space
from robot.planning.order import direction_rad, improved, turning_rad
from robot.planning.path import Lattice

SIDE = 120  # cells of 5 cm


def empty_room() -> Lattice:
    cells = np.zeros((SIDE, SIDE), np.int8)
    cells[[0, -1], :] = cells[:, [0, -1]] = 100
    grid = Grid(0.05, 0.0, 0.0, cells)
    space = build_space(
        grid, np.zeros(cells.shape, bool), SE2(3.0, 3.0), PlanningConfig(), RobotConfig()
    )
    assert space is not None
    return Lattice(space, 0.35, 4.0)


LATTICE = empty_room()
place = st.tuples(st.floats(40.0, 190.0), st.floats(40.0, 190.0)).map(np.array)


def both_ways(a: np.ndarray, b: np.ndarray) -> list[np.ndarray]:
    return [np.stack([a, b]), np.stack([b, a])]


def travel(ways, start, order) -> float:
    at, total = start, 0.0
    for piece, way in order:
        line = ways[piece][way]
        total += math.hypot(*(line[0] - at))
        at = line[-1]
    return total


@settings(max_examples=25, deadline=None)
@given(st.lists(st.tuples(place, place), min_size=1, max_size=9), place, st.randoms())
def test_never_longer_and_every_piece_once(ends, start, chance):
    ways = [both_ways(a, b) for a, b in ends]
    order = [(i, chance.randrange(2)) for i in range(len(ways))]
    chance.shuffle(order)
    better = improved(LATTICE, ways, start, 0.0, list(order), 0.0)
    assert sorted(piece for piece, _ in better) == list(range(len(ways)))
    # Straight lines are what the lattice's detours are measured by, up to its coarseness.
    assert travel(ways, start, better) <= 1.1 * travel(ways, start, order) + 8.0


def test_as_good_as_the_best_of_all_orders_of_five_lanes():
    rng = np.random.default_rng(3)
    for _ in range(4):
        ends = rng.uniform(45.0, 185.0, (5, 2, 2))
        ways, start = [both_ways(a, b) for a, b in ends], np.array([60.0, 60.0])
        best = min(
            travel(ways, start, list(zip(pieces, turns, strict=True)))
            for pieces in itertools.permutations(range(5))
            for turns in itertools.product((0, 1), repeat=5)
        )
        found = improved(LATTICE, ways, start, 0.0, [(i, 0) for i in range(5)], 0.0)
        assert travel(ways, start, found) <= 1.25 * best


def test_lanes_side_by_side_are_driven_to_and_fro():
    ways = [both_ways(np.array([50.0, y]), np.array([180.0, y])) for y in (60.0, 80.0, 100.0)]
    order = improved(LATTICE, ways, np.array([45.0, 60.0]), 0.0, [(0, 0), (2, 0), (1, 0)], 6.0)
    assert order == [(0, 0), (1, 1), (2, 0)]


def test_of_two_lanes_as_near_the_one_ahead_comes_first_where_turning_costs():
    start = np.array([110.0, 110.0])
    ways = [[start + np.array([[s * 20.0, 0.0], [s * 60.0, 0.0]])] for s in (1.0, -1.0)]
    ways = [both_ways(*way[0]) for way in ways]
    for heading_rad, first in ((0.0, 0), (math.pi, 1)):
        order = improved(LATTICE, ways, start, heading_rad, [(1 - first, 0), (first, 0)], 6.0)
        assert order[0] == (first, 0)


@given(place, place, st.floats(-math.pi, math.pi), st.floats(-math.pi, math.pi))
def test_turning_is_the_same_driven_backwards(a, b, before_rad, after_rad):
    there = turning_rad(b - a, before_rad, np.array(after_rad))
    back = turning_rad(a - b, after_rad + math.pi, np.array(before_rad + math.pi))
    assert abs(float(there) - float(back)) < 1e-6
    assert float(there) >= abs(math.remainder(after_rad - before_rad, 2.0 * math.pi)) - 1e-6
    assert abs(direction_rad(a, b)) <= math.pi
