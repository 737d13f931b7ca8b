"""Worlds from mesh files, on a room that the test makes."""

import sys

import numpy as np
import pytest

from robot.config import RobotConfig
from robot.errors import MissingExtraError, SceneError
from robot.geometry.se2 import SE2
from robot.sim.meshfile import load_mesh_world, slab_outlines
from robot.sim.rig import StereoRig
from robot.sim.scene import load_scene

trimesh = pytest.importorskip("trimesh")


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    """A 4 x 3 m room with a 1 m block in a corner, as GLB."""
    parts = [
        trimesh.creation.box(
            (4.2, 3.2, 0.1), trimesh.transformations.translation_matrix((2, 1.5, -0.05))
        )
    ]
    for size, at in (
        ((4.2, 0.1, 2.4), (2, -0.05, 1.2)), ((4.2, 0.1, 2.4), (2, 3.05, 1.2)),
        ((0.1, 3.2, 2.4), (-0.05, 1.5, 1.2)), ((0.1, 3.2, 2.4), (4.05, 1.5, 1.2)),
        ((1.0, 1.0, 0.6), (0.5, 0.5, 0.3)),
    ):  # fmt: skip
        parts.append(trimesh.creation.box(size, trimesh.transformations.translation_matrix(at)))
    path = tmp_path_factory.mktemp("mesh") / "room.glb"
    trimesh.Scene(parts).export(path)
    return path


def test_a_room_can_be_reached_and_has_a_dock(room):
    world = load_mesh_world(room, RobotConfig())
    floor = world.reachable(RobotConfig())
    whole = 4 * 3 - 1
    assert 0.8 * whole < floor.area_m2 < whole
    x0, y0, x1, y1 = world.bounds()
    assert x0 < world.dock.x_m < x1 and y0 < world.dock.y_m < y1


def test_a_toml_scene_puts_dock_and_furniture_into_a_mesh(room):
    path = room.parent / "with_dock.toml"
    path.write_text(
        f'mesh = "{room.name}"\n[dock]\nat = [3.92, 1.5]\nyaw_deg = 180.0\n'
        '[[furniture]]\nkind = "box"\nat = [2.0, 2.5]\nsize = [0.4, 0.4, 0.4]\n'
    )
    bare, world = load_mesh_world(room, RobotConfig()), load_scene(str(path))
    assert (world.dock.x_m, world.dock.y_m) == (3.92, 1.5)
    assert world.start.x_m < 3.8
    lost = bare.reachable(RobotConfig()).area_m2 - world.reachable(RobotConfig()).area_m2
    assert 0.1 < lost < 0.8


def test_the_mesh_and_the_dock_in_it_can_be_seen(room, config, perfect):
    world = load_mesh_world(room, RobotConfig())
    camera = config.camera.stereo_camera()
    frame, disparity = StereoRig(world, camera, perfect, 1).render(0, 0, world.start)
    marker_m = camera.depth_m(disparity)[120, 190]
    assert marker_m == pytest.approx(RobotConfig().radius_m + 0.09 - 0.001 - 0.13, abs=1e-3)
    assert frame.left.std() > 30
    behind = world.start @ SE2(-0.5, 0.0, np.pi)  # looking across the room at a wall
    _, disparity = StereoRig(world, camera, perfect, 1).render(0, 0, behind)
    assert np.isfinite(disparity).mean() > 0.5


def test_without_trimesh_the_extra_is_named(room, monkeypatch):
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with pytest.raises(MissingExtraError, match="pip install"):
        load_mesh_world(room, RobotConfig())


def test_only_what_is_in_the_way_has_an_outline():
    low = np.array([[0, 0, 0.05], [1, 0, 0.05], [0, 1, 0.05]], float)
    high = low + [0, 0, 0.5]
    wall = np.array([[0, 0, 0.0], [1, 0, 0.0], [1, 0, 1.0]], float)
    assert len(slab_outlines(np.array([low]))) == 1
    assert slab_outlines(np.array([high])) == ()
    outline = slab_outlines(np.array([wall]))[0]
    assert np.ptp(outline[:, 1]) < 1e-9 and np.ptp(outline[:, 0]) > 0.9


def test_a_file_that_is_no_mesh_is_refused(tmp_path):
    path = tmp_path / "bad.glb"
    path.write_bytes(b"not a mesh")
    with pytest.raises(SceneError, match=r"bad\.glb"):
        load_mesh_world(path, RobotConfig())
    with pytest.raises(SceneError, match="does not exist"):
        load_mesh_world(tmp_path / "none.glb", RobotConfig())
