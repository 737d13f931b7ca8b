"""Reads scenes: built-in ones by name, TOML files, and GLB or OBJ meshes.

A TOML scene lists rooms (floor and ceiling), walls with door gaps, furniture, cliffs and the dock.
Furniture stands at `at` with its front towards `yaw_deg`; `size` is depth, width, height in metres.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from importlib import resources
from pathlib import Path

import msgspec
import numpy as np
from msgspec import Struct

from robot.config import RobotConfig
from robot.errors import SceneError
from robot.geometry.se2 import SE2
from robot.sim.building import Building, along, build_dock, docked_pose
from robot.sim.world import World

Point = tuple[float, float]
Span = tuple[float, float]
WALL_THICK_M = 0.10


class Strict(Struct, frozen=True, forbid_unknown_fields=True):
    """A table of a scene file."""


class RoomTable(Strict):
    """A rectangle of floor and ceiling."""

    x: Span
    y: Span
    floor: str = "planks"
    lamp: bool = True


class WallTable(Strict):
    """A straight wall; `doors` are (distance along it of the middle, width)."""

    start: Point
    end: Point
    texture: str = "wallpaper"
    doors: list[Span] = []


class FurnitureTable(Strict):
    """One piece."""

    kind: str
    at: Point
    yaw_deg: float = 0.0
    size: tuple[float, float, float] | None = None
    texture: str = ""
    bottom: float = 0.0


class RectTable(Strict):
    """A rectangle of the floor plan."""

    x: Span
    y: Span


class DockTable(Strict):
    """Where the marker's face is, and where it looks."""

    at: Point
    yaw_deg: float


class SceneTable(Strict):
    """A scene file."""

    dock: DockTable
    rooms: list[RoomTable] = []
    walls: list[WallTable] = []
    furniture: list[FurnitureTable] = []
    cliffs: list[RectTable] = []
    ceiling: float = 2.4
    mesh: str = ""


def load_scene(name: str, robot: RobotConfig | None = None) -> World:
    """Build the built-in scene `name`, or the TOML, GLB or OBJ file at that path.

    Raises SceneError when there is none, or when a key of it is wrong.
    """
    path = Path(name)
    if path.suffix.lower() in (".glb", ".obj"):
        from robot.sim.meshfile import load_mesh_world

        return load_mesh_world(path, robot or RobotConfig())
    if path.suffix == ".toml":
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise SceneError(
                f"scene {name} cannot be read ({error}); give an existing TOML file."
            ) from None
    else:
        folder = resources.files("robot.sim") / "scenes"
        file = folder / f"{name}.toml"
        if not file.is_file():
            raise SceneError(
                f"scene '{name}' is unknown; choose one of {', '.join(builtin_scenes())}, or give "
                "the path of a TOML, GLB or OBJ file."
            )
        text = file.read_text(encoding="utf-8")
    return build_scene(parse_scene(text, name), name, robot or RobotConfig())


def builtin_scenes() -> list[str]:
    """Names of the scenes that come with the simulator."""
    folder = resources.files("robot.sim") / "scenes"
    return sorted(
        f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml")
    )


def parse_scene(text: str, name: str) -> SceneTable:
    """Read a scene file's text. Raises SceneError naming the key."""
    try:
        return msgspec.toml.decode(text, type=SceneTable)
    except msgspec.ValidationError as error:
        what, _, where = str(error).partition(" - at ")
        key = where.strip("`").removeprefix("$.") or "the top level"
        raise SceneError(f"scene {name}: {what} (at {key}); correct that key.") from None
    except msgspec.DecodeError as error:
        raise SceneError(f"scene {name}: not valid TOML: {error}; correct that line.") from None


def build_scene(table: SceneTable, name: str, robot: RobotConfig) -> World:
    """Put up walls and furniture. Raises SceneError for an unknown kind or texture."""
    building = Building()
    for room in table.rooms:
        building.floor(room.x[0], room.y[0], room.x[1], room.y[1], room.floor)
        building.ceiling(room.x[0], room.y[0], room.x[1], room.y[1], table.ceiling, "plaster:9")
        if room.lamp:
            building.lamps_m.append((sum(room.x) / 2, sum(room.y) / 2, table.ceiling - 0.3))
    for wall in table.walls:
        _wall(building, wall, table.ceiling)
    for piece in table.furniture:
        make = FURNITURE.get(piece.kind)
        if make is None:
            raise SceneError(
                f"scene {name}: furniture.kind '{piece.kind}' is unknown; choose one of "
                f"{', '.join(FURNITURE)}."
            )
        make(building, piece)
    dock = SE2(*table.dock.at, math.radians(table.dock.yaw_deg))
    build_dock(building, dock, robot)
    cliffs = tuple(
        np.array([[c.x[0], c.y[0]], [c.x[1], c.y[0]], [c.x[1], c.y[1]], [c.x[0], c.y[1]]])
        for c in table.cliffs
    )
    mesh, atlas = building.finish()
    return World(
        name, mesh, atlas, tuple(building.obstacles), cliffs, dock, docked_pose(dock, robot)
    )


def _wall(building: Building, wall: WallTable, height_m: float) -> None:
    (x0, y0), (x1, y1) = wall.start, wall.end
    start = SE2(x0, y0, math.atan2(y1 - y0, x1 - x0))
    length = math.hypot(x1 - x0, y1 - y0)
    at = 0.0
    for middle, width in [*sorted(wall.doors), (length + 1.0, 2.0)]:
        piece = middle - width / 2 - at
        if piece > 0.01:
            centre = SE2(*along(start, at + piece / 2), start.yaw_rad)
            building.box(centre, (piece, WALL_THICK_M, height_m), wall.texture)
        if middle < length:
            centre = SE2(*along(start, middle), start.yaw_rad)
            lintel = (width, WALL_THICK_M, height_m - 2.0)
            building.box(centre, lintel, wall.texture, bottom_m=2.0)
        at = middle + width / 2


# ---------------------------------------------------------------- furniture


def _pose(piece: FurnitureTable) -> SE2:
    return SE2(*piece.at, math.radians(piece.yaw_deg))


Make = Callable[[Building, FurnitureTable], None]


def _block(size: tuple[float, float, float], texture: str, front: str = "") -> Make:
    def make(building: Building, piece: FurnitureTable) -> None:
        building.box(
            _pose(piece),
            piece.size or size,
            piece.texture or texture,
            bottom_m=piece.bottom,
            front="" if piece.texture else front,
        )

    return make


def _seat(size: tuple[float, float, float], texture: str) -> Make:
    """Base, back and arms: a sofa or an armchair."""

    def make(building: Building, piece: FurnitureTable) -> None:
        depth, width, height = piece.size or size
        name, pose = piece.texture or texture, _pose(piece)
        building.box(pose, (depth, width, 0.5 * height), name)
        back = pose @ SE2(-0.4 * depth, 0.0, 0.0)
        building.box(back, (0.2 * depth, width, 0.5 * height), name, bottom_m=0.5 * height)

    return make


def _on_legs(size: tuple[float, float, float], top_m: float, leg_m: float, texture: str) -> Make:
    """A top on four legs: the robot drives beneath where it fits."""

    def make(building: Building, piece: FurnitureTable) -> None:
        depth, width, height = piece.size or size
        name, pose = piece.texture or texture, _pose(piece)
        building.legs(pose, (depth, width, height - top_m), leg_m, name)
        building.box(pose, (depth, width, top_m), name, bottom_m=height - top_m)

    return make


def _flat(size: tuple[float, float, float], texture: str) -> Make:
    def make(building: Building, piece: FurnitureTable) -> None:
        building.box(_pose(piece), (*(piece.size or size)[:2], 0.006), piece.texture or texture)

    return make


def _plant(building: Building, piece: FurnitureTable) -> None:
    depth, width, height = piece.size or (0.28, 0.28, 0.9)
    pose = _pose(piece)
    building.box(pose, (depth, width, 0.35 * height), piece.texture or "brick:4")
    leaves = (1.4 * depth, 1.4 * width, 0.6 * height)
    building.box(pose @ SE2(0, 0, 0.6), leaves, "leaves", bottom_m=0.4 * height)


FURNITURE: dict[str, Make] = {
    "box": _block((0.4, 0.4, 0.4), "wood"),
    "cabinet": _block((0.4, 0.8, 0.9), "wood:2", "cabinet"),
    "drawers": _block((0.45, 0.9, 0.8), "wood:3", "drawers"),
    "shelf": _block((0.3, 0.9, 1.8), "dark_wood", "books"),
    "kitchen": _block((0.6, 1.8, 0.9), "metal", "cabinet:5"),
    "bed": _block((2.0, 1.4, 0.45), "fabric:6"),
    "picture": _block((0.03, 0.6, 0.45), "picture"),
    "window": _block((0.02, 1.0, 1.0), "window"),
    "curtain": _block((0.05, 0.4, 2.2), "curtain"),
    "sofa": _seat((0.85, 1.8, 0.8), "fabric:1"),
    "armchair": _seat((0.75, 0.75, 0.8), "leather"),
    "table": _on_legs((0.8, 1.2, 0.74), 0.04, 0.06, "wood:4"),
    "chair": _on_legs((0.42, 0.42, 0.46), 0.04, 0.04, "dark_wood:2"),
    "rug": _flat((1.2, 1.7, 0.0), "oriental"),
    "plant": _plant,
}
