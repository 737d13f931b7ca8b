"""Rooms and doors by chance: a rectangle split again and again, its parts joined by doors.

Every wall stands where a room was split. Doors are a random spanning tree of the rooms that share
enough wall, so that all of them are reached, and a few more, so that some homes have loops.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robot.sim.scene_file import WallTable

HALF_WALL_M = 0.05
LEAST_SIDE_M = 2.1
DOOR_M = (0.85, 1.05)
JAMB_M = 0.30  # from a door to the next corner
LOOP_CHANCE = 0.3  # of a door that is not needed
PAPERS = ("wallpaper", "wallpaper", "plaster", "brick")


@dataclass(frozen=True, slots=True)
class Rect:
    """A rectangle along the axes, metres."""

    x0: float
    y0: float
    x1: float
    y1: float

    @property
    def area_m2(self) -> float:
        """Its area."""
        return (self.x1 - self.x0) * (self.y1 - self.y0)

    def grown(self, by_m: float) -> Rect:
        """Larger on all sides (or smaller)."""
        return Rect(self.x0 - by_m, self.y0 - by_m, self.x1 + by_m, self.y1 + by_m)

    def meets(self, other: Rect) -> bool:
        """True if the two share floor."""
        along = self.x0 < other.x1 and other.x0 < self.x1
        return along and self.y0 < other.y1 and other.y0 < self.y1

    def within(self, other: Rect) -> bool:
        """True if it lies wholly in the other."""
        along = self.x0 >= other.x0 and self.x1 <= other.x1
        return along and self.y0 >= other.y0 and self.y1 <= other.y1


@dataclass(frozen=True, slots=True)
class Door:
    """An opening in the wall across `axis` ("x": the wall runs along y) at `at_m`."""

    axis: str
    at_m: float
    middle_m: float
    width_m: float

    def zone(self, deep_m: float) -> Rect:
        """The floor before it, on both sides."""
        half = self.width_m / 2.0 + 0.10
        if self.axis == "x":
            low, high = self.at_m - deep_m, self.at_m + deep_m
            return Rect(low, self.middle_m - half, high, self.middle_m + half)
        low, high = self.at_m - deep_m, self.at_m + deep_m
        return Rect(self.middle_m - half, low, self.middle_m + half, high)


@dataclass(frozen=True, slots=True)
class Line:
    """A wall across `axis` at `at_m`, from `low_m` to `high_m` along the other."""

    axis: str
    at_m: float
    low_m: float
    high_m: float


@dataclass(frozen=True, slots=True)
class FloorPlan:
    """Rooms up to the middles of their walls; walls inside; doors."""

    whole: Rect
    rooms: list[Rect]
    lines: list[Line]
    doors: list[Door]

    def walls(self, rng: np.random.Generator) -> list[WallTable]:
        """The walls of a scene: four around, and those inside with their doors."""
        w, h = self.whole, HALF_WALL_M
        sides = [
            ((w.x0, w.y0 - h), (w.x1, w.y0 - h)),
            ((w.x1 + h, w.y0), (w.x1 + h, w.y1)),
            ((w.x1, w.y1 + h), (w.x0, w.y1 + h)),
            ((w.x0 - h, w.y1), (w.x0 - h, w.y0)),
        ]
        walls = [WallTable(start=a, end=b, texture=_paper(rng)) for a, b in sides]
        for line in self.lines:
            start, end = (line.at_m, line.low_m), (line.at_m, line.high_m)
            if line.axis == "y":
                start, end = start[::-1], end[::-1]
            gaps = sorted(
                (round(door.middle_m - line.low_m, 4), door.width_m)
                for door in self.doors
                if (door.axis, door.at_m) == (line.axis, line.at_m)
                and line.low_m <= door.middle_m <= line.high_m
            )
            walls.append(WallTable(start=start, end=end, texture=_paper(rng), doors=gaps))
        return walls


def _paper(rng: np.random.Generator) -> str:
    return f"{PAPERS[rng.integers(len(PAPERS))]}:{rng.integers(100)}"


def floor_plan(
    rng: np.random.Generator, width_m: float, depth_m: float, rooms: int
) -> FloorPlan | None:
    """`rooms` rooms in a rectangle; None where they come out too small or cannot be joined."""
    whole = Rect(0.0, 0.0, width_m, depth_m)
    parts, lines = [whole], []
    while len(parts) < rooms:
        room = max(parts, key=lambda part: part.area_m2)
        halves, line = _split(rng, room)
        if min(min(r.x1 - r.x0, r.y1 - r.y0) for r in halves) < LEAST_SIDE_M:
            return None
        parts.remove(room)
        parts += halves
        lines.append(line)
    doors = _doors(rng, parts)
    return None if doors is None else FloorPlan(whole, parts, lines, doors)


def _split(rng: np.random.Generator, room: Rect) -> tuple[list[Rect], Line]:
    """Across the longer side, somewhere about the middle."""
    share = float(rng.uniform(0.36, 0.64))
    if room.x1 - room.x0 >= room.y1 - room.y0:
        at = round(room.x0 + share * (room.x1 - room.x0), 2)
        halves = [Rect(room.x0, room.y0, at, room.y1), Rect(at, room.y0, room.x1, room.y1)]
        return halves, Line("x", at, room.y0, room.y1)
    at = round(room.y0 + share * (room.y1 - room.y0), 2)
    halves = [Rect(room.x0, room.y0, room.x1, at), Rect(room.x0, at, room.x1, room.y1)]
    return halves, Line("y", at, room.x0, room.x1)


def _doors(rng: np.random.Generator, rooms: list[Rect]) -> list[Door] | None:
    """A random spanning tree over rooms that share a wall, and some doors more."""
    shared = [
        (i, j, *wall)
        for i, a in enumerate(rooms)
        for j, b in enumerate(rooms)
        if (wall := _shared(a, b)) is not None
    ]
    group = list(range(len(rooms)))
    doors = []
    for k in rng.permutation(len(shared)):
        i, j, axis, at, low, high = shared[k]
        needed = group[i] != group[j]
        if not needed and rng.random() > LOOP_CHANCE:
            continue
        old, new = group[j], group[i]
        group = [new if g == old else g for g in group]
        width = round(float(rng.uniform(*DOOR_M)), 2)
        reach = JAMB_M + width / 2.0
        doors.append(Door(axis, at, round(float(rng.uniform(low + reach, high - reach)), 2), width))
    return doors if len(set(group)) == 1 else None


def _shared(a: Rect, b: Rect) -> tuple[str, float, float, float] | None:
    """The wall on which `b` lies beyond `a`, if a door fits into it: axis, place, from, to."""
    if a.x1 == b.x0:
        axis, at, low, high = "x", a.x1, max(a.y0, b.y0), min(a.y1, b.y1)
    elif a.y1 == b.y0:
        axis, at, low, high = "y", a.y1, max(a.x0, b.x0), min(a.x1, b.x1)
    else:
        return None
    return (axis, at, low, high) if high - low > DOOR_M[1] + 2.0 * JAMB_M + 0.02 else None
