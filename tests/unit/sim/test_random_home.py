"""Homes by seed and built-in homes: closed, reachable, easy to get round, always the same."""

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.config import RobotConfig
from robot.errors import SceneError
from robot.sim.floor_plan import Rect, floor_plan
from robot.sim.random_home import livable, random_home
from robot.sim.scene import builtin_scenes, load_scene
from robot.sim.scene_file import parse_scene

ROBOT = RobotConfig()
FEW = settings(max_examples=25, deadline=None)


def area_m2(table):
    return sum((r.x[1] - r.x[0]) * (r.y[1] - r.y[0]) for r in table.rooms)


def without_nothing(value):
    """TOML has no null: what is not given is left out."""
    if isinstance(value, dict):
        return {k: without_nothing(v) for k, v in value.items() if v is not None}
    return [without_nothing(v) for v in value] if isinstance(value, list | tuple) else value


def is_closed(world):
    """No way leads from the dock to the outside, not even for a point."""
    import cv2

    occupied, x0, y0 = world.occupancy(0.02)
    _, labels = cv2.connectedComponents((~occupied).astype(np.uint8), connectivity=4)
    away = world.start.apply(np.array([-0.6, 0.0]))
    inside = labels[int((away[1] - y0) / 0.02), int((away[0] - x0) / 0.02)]
    border = np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]])
    return inside > 0 and inside not in border


@FEW
@given(st.integers(0, 10**9))
def test_every_seed_is_a_home(seed):
    table, world = random_home(seed, ROBOT), load_scene(f"random:{seed}")
    assert 20.0 - 1.5 <= area_m2(table) <= 60.0  # stairs take some floor
    assert is_closed(world)
    assert livable(world, ROBOT, area_m2(table))
    assert all(width >= 0.8 for wall in table.walls for _, width in wall.doors)


@FEW
@given(st.integers(0, 10**9))
def test_a_seed_is_the_same_home_every_time_and_its_file_is_a_scene_file(seed):
    table = random_home(seed, ROBOT)
    text = msgspec.toml.encode(without_nothing(msgspec.to_builtins(table))).decode()
    assert parse_scene(text, "copy.toml") == table == random_home(seed, ROBOT)


@FEW
@given(st.integers(0, 2**32), st.integers(1, 6))
def test_rooms_fill_the_plan_and_doors_join_them(seed, count):
    rng = np.random.default_rng(seed)
    plan = floor_plan(rng, 8.0, 6.5, count)
    if plan is None:
        return
    assert len(plan.rooms) == count
    assert sum(room.area_m2 for room in plan.rooms) == pytest.approx(52.0)
    group = list(range(count))
    for door in plan.doors:
        joined = {k for k, room in enumerate(plan.rooms) if door.zone(0.2).meets(room)}
        assert len(joined) == 2
        low = min(group[k] for k in joined)
        gone = {group[k] for k in joined}
        group = [low if g in gone else g for g in group]
    assert set(group) == {0}


def test_seeds_differ():
    assert len({msgspec.json.encode(random_home(seed, ROBOT)) for seed in range(12)}) == 12


@pytest.mark.parametrize("name", ["random:", "random:x", "random:-1", "random:1.5"])
def test_a_seed_that_is_no_number_is_named(name):
    with pytest.raises(SceneError, match="whole number"):
        load_scene(name)


@pytest.mark.parametrize("name", builtin_scenes())
def test_built_in_homes_are_closed_and_reached(name):
    """At least 95 % of the places where the robot fits are reached from the dock."""
    world = load_scene(name)
    assert is_closed(world)
    assert livable(world, ROBOT, 0.0, least_easy=0.9, least_joined=0.95)


def test_there_are_twelve_homes_of_20_to_60_m2_and_larger_ones():
    areas = []
    for name in builtin_scenes():
        low_x, low_y, high_x, high_y = load_scene(name).bounds()
        areas.append((high_x - low_x - 0.2) * (high_y - low_y - 0.2))
    assert sum(20.0 <= area <= 60.5 for area in areas) >= 12
    assert max(areas) > 100.0


def test_a_rectangle_meets_what_it_shares_floor_with():
    rect = Rect(0.0, 0.0, 2.0, 1.0)
    assert rect.meets(Rect(1.9, 0.9, 3.0, 3.0)) and not rect.meets(Rect(2.0, 0.0, 3.0, 1.0))
    assert Rect(0.5, 0.0, 2.0, 1.0).within(rect) and not rect.grown(0.1).within(rect)
