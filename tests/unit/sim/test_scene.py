"""Scenes: every built-in one can be lived in, and mistakes in files are named."""

import numpy as np
import pytest

from robot.config import RobotConfig
from robot.errors import SceneError
from robot.geometry.se2 import SE2
from robot.sim.scene import builtin_scenes, load_scene, parse_scene

ROBOT = RobotConfig()


@pytest.mark.parametrize("name", builtin_scenes())
def test_every_built_in_scene_can_be_lived_in(name):
    world = load_scene(name)
    floor = world.reachable(ROBOT)
    occupied, x0, y0 = world.occupancy()
    behind = world.start @ SE2(-0.3, 0.0, 0.0)
    assert 4.0 < floor.area_m2 < 22.0
    assert not occupied[int((behind.y_m - y0) / 0.02), int((behind.x_m - x0) / 0.02)]
    assert not (floor.floor & occupied).any()
    assert (floor.floor | ~floor.centres).all()


def test_there_are_four_scenes_and_one_has_stairs():
    assert len(builtin_scenes()) >= 4
    assert load_scene("stairs").cliffs


def test_the_docked_robot_touches_the_plate_with_its_front(flat):
    front = flat.start.apply(np.array([ROBOT.radius_m, 0.0]))
    gap = min(np.min(np.hypot(*(polygon - front).T)) for polygon in flat.obstacles)
    assert gap < 0.11
    towards = flat.start.inverse() @ flat.dock
    assert towards.x_m > ROBOT.radius_m and abs(towards.y_m) < 1e-9


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("[dock]\nat = [0.0, 0.0]", "yaw_deg"),
        ("[dock]\nat = [0.0, 0.0]\nyaw_deg = 0.0\ncolour = 1", "dock"),
        ("x = [", "TOML"),
    ],
)
def test_a_mistake_in_a_scene_is_named(text, named):
    with pytest.raises(SceneError, match=named):
        parse_scene(text, "my.toml")


def test_unknown_furniture_is_named_with_the_choices(tmp_path):
    path = tmp_path / "s.toml"
    path.write_text('[dock]\nat=[0,0]\nyaw_deg=0\n[[furniture]]\nkind="piano"\nat=[1,1]\n')
    with pytest.raises(SceneError, match=r"piano.*sofa"):
        load_scene(str(path))


def test_a_dock_with_no_room_behind_it_is_refused(tmp_path):
    path = tmp_path / "s.toml"
    path.write_text(
        '[dock]\nat=[0,0]\nyaw_deg=0\n[[furniture]]\nkind="box"\nat=[0.6,0]\nsize=[0.5,0.5,0.5]\n'
    )
    with pytest.raises(SceneError, match="dock"):
        load_scene(str(path)).reachable(ROBOT)


def test_an_unknown_scene_lists_the_known_ones():
    with pytest.raises(SceneError, match=r"nowhere.*flat"):
        load_scene("nowhere")
