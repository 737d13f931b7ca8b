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
    assert 4.0 < floor.area_m2 < 120.0
    assert not occupied[int((behind.y_m - y0) / 0.02), int((behind.x_m - x0) / 0.02)]
    assert not (floor.floor & occupied).any()
    assert (floor.floor | ~floor.centres).all()


def test_some_scenes_have_stairs():
    assert {"stairs", "maisonette", "villa"} <= {
        n for n in builtin_scenes() if load_scene(n).cliffs
    }


def test_behind_glass_there_is_nothing_to_see_but_something_to_bump_into(tmp_path):
    path = tmp_path / "s.toml"
    path.write_text(DOCK + '[[furniture]]\nkind="glass"\nat=[3,1]\nsize=[0.06,2.0,2.0]\n')
    world = load_scene(str(path))
    pane = world.obstacles[2]
    assert np.ptp(pane[:, 1]) == pytest.approx(2.0)
    faces = world.mesh.vertices_m
    faces = faces[(np.abs(faces[:, :, 0] - 3.0) < 0.1).all(axis=1)]
    size = np.ptp(faces, axis=1)
    assert len(faces) and not ((size[:, 1] > 1.0) & (size[:, 2] > 1.0)).any()


def test_the_docked_robot_touches_the_plate_with_its_front(flat):
    front = flat.start.apply(np.array([ROBOT.radius_m, 0.0]))
    gap = min(np.min(np.hypot(*(polygon - front).T)) for polygon in flat.obstacles)
    assert gap < 0.11
    towards = flat.start.inverse() @ flat.dock
    assert towards.x_m > ROBOT.radius_m and abs(towards.y_m) < 1e-9


DOCK = "[dock]\nat = [0.1, 1.0]\nyaw_deg = 0.0\n"


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("[dock]\nat = [0.0, 0.0]", "yaw_deg"),
        (DOCK + "colour = 1", "dock"),
        ("x = [", "TOML"),
        (DOCK + "[[rooms]]\nx = [2, 1]\ny = [0, 1]", r"rooms\[0\]\.x"),
        (DOCK + '[[rooms]]\nx = [0, 1]\ny = "wide"', r"rooms"),
        (DOCK + "[[walls]]\nstart = [0, 0]\nend = [0, 0]", r"walls\[0\]"),
        (DOCK + "[[walls]]\nstart = [0, 0]\nend = [2, 0]\ndoors = [[1.8, 0.9]]", "doors"),
        (DOCK + "[[walls]]\nstart = [0, 0]\nend = [nan, 0]", r"walls\[0\]\.end\[0\]"),
        (DOCK + '[[furniture]]\nkind = "box"\nat = [2, 2]\nsize = [0, 1, 1]', "size"),
        (DOCK + '[[furniture]]\nkind = "box"\nat = [2, 2]\nbottom = -1.0', "bottom"),
        (DOCK + '[[cliffs]]\nx = [0, 1]\ny = [0, 1]\ndown = "away"', "down"),
    ],
)
def test_a_mistake_in_a_scene_is_named(text, named):
    with pytest.raises(SceneError, match=named) as caught:
        parse_scene(text, "my.toml")
    assert "my.toml" in str(caught.value) and "\n" not in str(caught.value)


def test_an_unknown_texture_is_named_with_its_table(tmp_path):
    path = tmp_path / "s.toml"
    path.write_text(DOCK + '[[rooms]]\nx=[0,3]\ny=[0,2]\nfloor="lava"\n')
    with pytest.raises(SceneError, match=r"s\.toml: rooms\[0\]: .*lava"):
        load_scene(str(path))


def test_a_dock_behind_a_cupboard_is_refused(tmp_path):
    path = tmp_path / "s.toml"
    path.write_text(DOCK + '[[furniture]]\nkind="box"\nat=[0.5,1.0]\n')
    with pytest.raises(SceneError, match=r"dock\.at"):
        load_scene(str(path))


def test_an_empty_room_is_reached_as_geometry_says(tmp_path):
    """3 x 2 m inside the skirting boards: centres keep the radius, the brush half its width."""
    path = tmp_path / "room.toml"
    walls = [((0, -0.05), (3, -0.05)), ((0, 2.05), (3, 2.05)), ((-0.05, 0), (-0.05, 2)),
             ((3.05, 0), (3.05, 2))]  # fmt: skip
    text = DOCK.replace("1.0]", "-0.6]") + "".join(
        f"[[walls]]\nstart=[{a[0]},{a[1]}]\nend=[{b[0]},{b[1]}]\n" for a, b in walls
    )
    path.write_text(text.replace("at = [0.1, -0.6]", "at = [0.1, 1.0]"))
    floor = load_scene(str(path)).reachable(ROBOT, 0.01)
    width, depth = 3 - 2 * (0.012 + ROBOT.radius_m), 2 - 2 * (0.012 + ROBOT.radius_m)
    centres = floor.centres.sum() * 1e-4
    dock = 0.19 + ROBOT.radius_m - 0.012 - ROBOT.radius_m, 0.2 + 2 * ROBOT.radius_m
    assert width * depth - dock[0] * dock[1] - 0.02 < centres < width * depth
    b = ROBOT.brush_width_m / 2
    grown = width * depth + 2 * b * (width + depth) + np.pi * b * b
    assert grown - (dock[0] + 0.1) * (dock[1] - b) - 0.03 < floor.area_m2 < grown


def test_a_cliff_is_not_reachable():
    world = load_scene("stairs")
    floor = world.reachable(ROBOT)
    rows, columns = np.nonzero(floor.centres)
    x = floor.origin_x_m + (columns + 0.5) * floor.resolution_m
    y = floor.origin_y_m + (rows + 0.5) * floor.resolution_m
    (x0, y0), (x1, y1) = world.cliffs[0].min(axis=0), world.cliffs[0].max(axis=0)
    away = np.hypot(
        np.maximum(np.maximum(x0 - x, x - x1), 0), np.maximum(np.maximum(y0 - y, y - y1), 0)
    )
    assert away.min() >= ROBOT.radius_m - 1e-9


def test_doors_of_built_in_scenes_are_wide_enough():
    from importlib import resources

    for name in builtin_scenes():
        text = (resources.files("robot.sim") / "scenes" / f"{name}.toml").read_text("utf-8")
        for wall in parse_scene(text, name).walls:
            assert all(width >= 0.8 for _, width in wall.doors), name


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
