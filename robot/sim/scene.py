"""Builds worlds: built-in scenes by name, `random:SEED`, TOML files, GLB or OBJ meshes."""

from __future__ import annotations

import math
from importlib import resources
from pathlib import Path

import numpy as np

from robot.config import RobotConfig
from robot.errors import SceneError
from robot.geometry.se2 import SE2
from robot.sim.building import Building, docked_pose
from robot.sim.collide import nearest
from robot.sim.furniture import FURNITURE
from robot.sim.scene_file import (
    DOOR_HEIGHT_M,
    CliffTable,
    RoomTable,
    SceneTable,
    WallTable,
    parse_scene,
)
from robot.sim.world import World, segments_of

RANDOM = "random:"
WALL_THICK_M = 0.10
SKIRTING_M = (0.012, 0.06)  # thickness and height
PIT_DEPTH_M, STEP_RUN_M, STEP_RISE_M = 1.2, 0.25, 0.18


def load_scene(name: str, robot: RobotConfig | None = None) -> World:
    """Build the built-in scene `name`, the home `random:SEED`, or the TOML, GLB or OBJ file there.

    Raises SceneError when there is none, or when a key of it is wrong; MissingExtraError when a
    mesh is asked for without trimesh.
    """
    path, robot = Path(name), robot or RobotConfig()
    if name.startswith(RANDOM):
        from robot.sim.random_home import random_home

        return build_scene(random_home(_seed_of(name), robot), name, robot)
    if path.suffix.lower() in (".glb", ".obj"):
        from robot.sim.meshfile import load_mesh_world

        return load_mesh_world(path, robot)
    if path.suffix == ".toml":
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise SceneError(
                f"scene {name} cannot be read ({error}); give an existing TOML file."
            ) from None
        return build_scene(parse_scene(text, name), name, robot, path.parent)
    file = resources.files("robot.sim") / "scenes" / f"{name}.toml"
    if not file.is_file():
        raise SceneError(
            f"scene '{name}' is unknown; choose one of {', '.join(builtin_scenes())}, "
            "random:SEED, or give the path of a TOML, GLB or OBJ file."
        )
    return build_scene(parse_scene(file.read_text(encoding="utf-8"), name), name, robot)


def _seed_of(name: str) -> int:
    """The number in `random:NUMBER`. Raises SceneError."""
    seed = name.removeprefix(RANDOM)
    if not (seed.isascii() and seed.isdecimal() and len(seed) <= 18):
        raise SceneError(f"scene '{name}': give a whole number, like {RANDOM}7.")
    return int(seed)


def builtin_scenes() -> list[str]:
    """Names of the scenes that come with the simulator."""
    folder = resources.files("robot.sim") / "scenes"
    return sorted(
        f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml")
    )


def build_scene(
    table: SceneTable, name: str, robot: RobotConfig, folder: Path | None = None
) -> World:
    """Put up walls and furniture; a `mesh` is looked for in `folder`.

    Raises SceneError for an unknown texture, a missing mesh, or a dock that stands in the way.
    """
    building, dock = Building(), SE2(*table.dock.at, math.radians(table.dock.yaw_deg))
    key = ""
    try:
        for i, room in enumerate(table.rooms):
            key = f"rooms[{i}]"
            _room(building, room, table)
        for i, wall in enumerate(table.walls):
            key = f"walls[{i}]"
            _wall(building, wall, table.ceiling)
        for i, piece in enumerate(table.furniture):
            key = f"furniture[{i}]"
            pose = SE2(*piece.at, math.radians(piece.yaw_deg))
            FURNITURE[piece.kind](building, pose, piece.size, piece.texture, piece.bottom)
        for cliff in table.cliffs:
            _stairwell(building, cliff, table.ceiling)
    except SceneError as error:
        raise SceneError(f"scene {name}: {key}: {error}") from None
    if table.mesh:
        from robot.sim.meshfile import load_mesh_world

        return load_mesh_world((folder or Path()) / table.mesh, robot, dock=dock, extra=building)
    start = docked_pose(dock, robot)
    walls = segments_of(building.obstacles)
    if nearest(walls, start.x_m, start.y_m, robot.radius_m)[0] < robot.radius_m - 0.005:
        raise SceneError(
            f"scene {name}: dock.at leaves no room for the robot on its dock; move the dock, or "
            "what stands before it."
        )
    building.dock(dock, robot)
    cliffs = tuple(
        np.array([[c.x[0], c.y[0]], [c.x[1], c.y[0]], [c.x[1], c.y[1]], [c.x[0], c.y[1]]])
        for c in table.cliffs
    )
    return World(name, tuple(building.obstacles), cliffs, dock, start, building.draw)


def _room(building: Building, room: RoomTable, table: SceneTable) -> None:
    (x0, x1), (y0, y1) = room.x, room.y
    building.floor(x0, y0, x1, y1, room.floor)
    building.ceiling(x0, y0, x1, y1, table.ceiling, "plaster:9")
    if room.lamp:
        building.lamp((x0 + x1) / 2, (y0 + y1) / 2, table.ceiling - 0.3)


def _wall(building: Building, wall: WallTable, height_m: float) -> None:
    """A wall in pieces between its doors, skirting boards along them, lintels above the doors."""
    (x0, y0), (x1, y1) = wall.start, wall.end
    start = SE2(x0, y0, math.atan2(y1 - y0, x1 - x0))
    length = math.dist(wall.start, wall.end)
    at = 0.0
    for middle, width in [*sorted(wall.doors), (length + 1.0, 2.0)]:
        piece = middle - width / 2 - at
        if piece > 0.01:
            centre = start @ SE2(at + piece / 2, 0.0, 0.0)
            building.box(centre, (piece, WALL_THICK_M, height_m), wall.texture)
            thick = WALL_THICK_M + 2 * SKIRTING_M[0]
            building.box(centre, (piece, thick, SKIRTING_M[1]), "plain:3")
        if middle < length:
            lintel = (width, WALL_THICK_M, height_m - DOOR_HEIGHT_M)
            centre = start @ SE2(middle, 0.0, 0.0)
            building.box(centre, lintel, wall.texture, bottom_m=DOOR_HEIGHT_M)
        at = middle + width / 2


def _stairwell(building: Building, cliff: CliffTable, ceiling_m: float) -> None:
    """Steps in a shaft, and the ceiling above."""
    (x0, x1), (y0, y1) = cliff.x, cliff.y
    building.ceiling(x0, y0, x1, y1, ceiling_m, "plaster:9")
    ring = np.array([[x0, y0], [x0, y1], [x1, y1], [x1, y0]])  # clockwise: the faces look inward
    for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        corners = [[*a, -PIT_DEPTH_M], [*b, -PIT_DEPTH_M], [*b, 0.0], [*a, 0.0]]
        building.face(np.array(corners), "plaster:4")
    yaw = {"+x": 0.0, "+y": 0.5 * math.pi, "-x": math.pi, "-y": -0.5 * math.pi}[cliff.down]
    long, wide = (x1 - x0, y1 - y0) if cliff.down[1] == "x" else (y1 - y0, x1 - x0)
    edge = SE2((x0 + x1) / 2, (y0 + y1) / 2, yaw) @ SE2(-long / 2, 0.0, 0.0)
    for k in range(math.ceil(long / STEP_RUN_M)):
        run = min(STEP_RUN_M, long - k * STEP_RUN_M)
        height = max(PIT_DEPTH_M - (k + 1) * STEP_RISE_M, 0.02)
        centre = edge @ SE2(k * STEP_RUN_M + run / 2, 0.0, 0.0)
        building.box(centre, (run, wide, height), "wood:5", bottom_m=-PIT_DEPTH_M)
