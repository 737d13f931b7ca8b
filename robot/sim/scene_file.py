"""Scene files: their tables, read from TOML and checked.

A scene lists rooms (floor and ceiling), walls with door gaps, furniture, cliffs and the dock, or
names a `mesh` and puts the dock into it. Furniture stands at `at` with its front towards
`yaw_deg`; `size` is depth, width, height in metres.
"""

from __future__ import annotations

import math
from typing import Literal

import msgspec
from msgspec import Struct

from robot.errors import SceneError
from robot.sim.furniture import FURNITURE

Point = tuple[float, float]
Span = tuple[float, float]
DOOR_HEIGHT_M = 2.0


class Strict(Struct, frozen=True, forbid_unknown_fields=True):
    """A table of a scene file."""


class RoomTable(Strict, frozen=True):
    """A rectangle of floor and ceiling."""

    x: Span
    y: Span
    floor: str = "planks"
    lamp: bool = True


class WallTable(Strict, frozen=True):
    """A straight wall; `doors` are (distance along it of the middle, width)."""

    start: Point
    end: Point
    texture: str = "wallpaper"
    doors: list[Span] = []


class FurnitureTable(Strict, frozen=True):
    """One piece."""

    kind: str
    at: Point
    yaw_deg: float = 0.0
    size: tuple[float, float, float] | None = None
    texture: str = ""
    bottom: float = 0.0


class CliffTable(Strict, frozen=True):
    """A rectangle without floor; stairs go `down` there."""

    x: Span
    y: Span
    down: Literal["+x", "-x", "+y", "-y"] = "+x"


class DockTable(Strict, frozen=True):
    """Where the marker's face is, and where it looks."""

    at: Point
    yaw_deg: float


class SceneTable(Strict, frozen=True):
    """A scene file."""

    dock: DockTable
    rooms: list[RoomTable] = []
    walls: list[WallTable] = []
    furniture: list[FurnitureTable] = []
    cliffs: list[CliffTable] = []
    ceiling: float = 2.4
    mesh: str = ""


def parse_scene(text: str, name: str) -> SceneTable:
    """Read a scene file's text. Raises SceneError naming the key."""
    try:
        table = msgspec.toml.decode(text, type=SceneTable)
    except msgspec.ValidationError as error:
        what, _, where = str(error).partition(" - at ")
        key = where.strip("`").removeprefix("$.") or "the top level"
        raise SceneError(f"scene {name}: {what} (at {key}); correct that key.") from None
    except msgspec.DecodeError as error:
        raise SceneError(f"scene {name}: not valid TOML: {error}; correct that line.") from None
    for key, problem in _problems(table):
        raise SceneError(f"scene {name}: {key} {problem}; correct that key.")
    return table


def _problems(table: SceneTable) -> list[tuple[str, str]]:
    """(key, what is wrong) of what TOML's types cannot say."""
    found = [
        (key, "has a number that is not finite or beyond 1000")
        for key, number in _numbers(msgspec.to_builtins(table), "")
        if not abs(number) <= 1000.0
    ]
    rects = [(f"rooms[{i}]", room.x, room.y) for i, room in enumerate(table.rooms)]
    rects += [(f"cliffs[{i}]", cliff.x, cliff.y) for i, cliff in enumerate(table.cliffs)]
    for name, *spans in rects:
        for axis, (low, high) in zip("xy", spans, strict=True):
            if not low < high:
                found.append((f"{name}.{axis}", "must be (low, high) with low < high"))
    for i, wall in enumerate(table.walls):
        length, at = math.dist(wall.start, wall.end), 0.0
        if not length > 0.05:
            found.append((f"walls[{i}]", "is shorter than 5 cm"))
        for middle, width in sorted(wall.doors):
            if not (width > 0 and middle - width / 2 >= at and middle + width / 2 <= length):
                found.append((f"walls[{i}].doors", f"do not fit one by one into {length:.2f} m"))
            at = middle + width / 2
    for i, piece in enumerate(table.furniture):
        if piece.kind not in FURNITURE:
            choices = ", ".join(FURNITURE)
            found.append((f"furniture[{i}].kind", f"'{piece.kind}' is none of {choices}"))
        if piece.size and (min(piece.size[:2]) <= 0 or piece.size[2] < 0):
            found.append((f"furniture[{i}].size", "must be positive"))
        if piece.bottom < 0:
            found.append((f"furniture[{i}].bottom", "lies below the floor"))
    if not table.ceiling > DOOR_HEIGHT_M:
        found.append(("ceiling", f"must be above the doors' {DOOR_HEIGHT_M} m"))
    return found


def _numbers(value: object, key: str) -> list[tuple[str, float]]:
    if isinstance(value, dict):
        return [n for k, v in value.items() for n in _numbers(v, f"{key}.{k}" if key else k)]
    if isinstance(value, list | tuple):
        return [n for k, v in enumerate(value) for n in _numbers(v, f"{key}[{k}]")]
    if isinstance(value, float):
        return [(key, value)]
    return []
