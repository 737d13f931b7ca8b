"""What people draw on the map: no-go areas, walls, zones, and rooms cut, joined and named.

Everything is a place in `world`, never a number of a cell or of a room: the map may grow and rooms
may be found anew, and the drawings stay where they were put. Frozen; `to_dict` and `from_dict` are
for saving.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from robot.errors import MapError

Point = tuple[float, float]
MAX_MARKS = 100  # of one kind
MAX_CORNERS = 64
MAX_NAME = 40
FAR_M = 100.0
MIN_AREA_M2 = 0.0025  # a smaller area is a slip of the finger
MIN_LENGTH_M = 0.05


@dataclass(frozen=True, slots=True)
class Area:
    """A polygon (closed by itself): the robot's footprint stays out of it, or a zone to sweep."""

    name: str
    corners_m: tuple[Point, ...]

    def holds(self, x_m: float, y_m: float) -> bool:
        """Whether a point lies inside (even-odd rule)."""
        inside, (ax, ay) = False, self.corners_m[-1]
        for bx, by in self.corners_m:
            if (ay > y_m) != (by > y_m) and x_m < ax + (y_m - ay) * (bx - ax) / (by - ay):
                inside = not inside
            ax, ay = bx, by
        return inside

    def sides(self) -> list[tuple[Point, Point]]:
        """Its border, one side after the other."""
        corners = self.corners_m
        return list(zip(corners, corners[1:] + corners[:1], strict=True))


@dataclass(frozen=True, slots=True)
class Line:
    """A straight line: a virtual wall, or a cut through a room."""

    name: str
    start_m: Point
    end_m: Point


@dataclass(frozen=True, slots=True)
class Join:
    """The rooms at these two places are one."""

    name: str
    one_m: Point
    other_m: Point


@dataclass(frozen=True, slots=True)
class RoomName:
    """The room at this place has a name."""

    name: str
    at_m: Point


Mark = Area | Line | Join | RoomName


@dataclass(frozen=True, slots=True)
class Annotations:
    """All drawings on one map. Names are unique within a kind."""

    no_go: tuple[Area, ...] = ()
    walls: tuple[Line, ...] = ()
    cuts: tuple[Line, ...] = ()
    joins: tuple[Join, ...] = ()
    rooms: tuple[RoomName, ...] = ()
    zones: tuple[Area, ...] = ()

    def barriers(self) -> list[tuple[Point, Point]]:
        """Every line that the footprint must not cross: borders of areas, and walls."""
        sides = [side for area in self.no_go for side in area.sides()]
        return sides + [(wall.start_m, wall.end_m) for wall in self.walls]

    def holding(self, x_m: float, y_m: float) -> Area | None:
        """The no-go area in which a point lies, if any."""
        return next((area for area in self.no_go if area.holds(x_m, y_m)), None)

    def distance_m(self, x_m: float, y_m: float) -> float:
        """From a point to the nearest forbidden one: 0 inside an area, infinite without any."""
        if self.holding(x_m, y_m) is not None:
            return 0.0
        return min((_segment_m(x_m, y_m, *line) for line in self.barriers()), default=math.inf)

    def zone(self, name: str) -> Area:
        """The zone of that name, in capitals or not. Raises MapError when there is none."""
        for area in self.zones:
            if area.name.casefold() == name.casefold():
                return area
        known = ", ".join(area.name for area in self.zones) or "none"
        raise MapError(f"no zone is called {name!r}; there is: {known}.")

    def add(self, kind: str, mark: Mark) -> Annotations:
        """With one more mark of `kind` (a field's name). Raises MapError for an impossible one."""
        marks = getattr(self, kind)
        if len(marks) >= MAX_MARKS:
            raise MapError(f"{kind}: there are {MAX_MARKS} of them already; remove some first.")
        if any(other.name == mark.name for other in marks):
            raise MapError(f"{kind}: {mark.name!r} exists already; take another name.")
        _check(kind, mark)
        return replace(self, **{kind: (*marks, mark)})

    def remove(self, kind: str, name: str) -> Annotations:
        """Without the mark `name` of `kind`. Raises MapError when there is none."""
        marks = getattr(self, kind)
        kept = tuple(mark for mark in marks if mark.name != name)
        if len(kept) == len(marks):
            known = ", ".join(mark.name for mark in marks) or "none"
            raise MapError(f"{kind}: nothing there is called {name!r}; there is: {known}.")
        return replace(self, **{kind: kept})

    def free_name(self, kind: str, stem: str) -> str:
        """The first of stem 1, stem 2, ... that no mark of `kind` has."""
        taken = {mark.name for mark in getattr(self, kind)}
        return next(n for i in range(1, MAX_MARKS + 2) if (n := f"{stem} {i}") not in taken)

    def to_dict(self) -> dict[str, Any]:
        """Plain lists, texts and numbers, as JSON holds them."""
        return {
            "no_go": [_area_dict(area) for area in self.no_go],
            "walls": [_line_dict(line) for line in self.walls],
            "cuts": [_line_dict(line) for line in self.cuts],
            "joins": [
                {"name": j.name, "one_m": list(j.one_m), "other_m": list(j.other_m)}
                for j in self.joins
            ],
            "rooms": [{"name": r.name, "at_m": list(r.at_m)} for r in self.rooms],
            "zones": [_area_dict(area) for area in self.zones],
        }

    @classmethod
    def from_dict(cls, plain: Mapping[str, Any], name: str = "map") -> Annotations:
        """What `to_dict` gave. Raises MapError, naming `name` and the mark that makes no sense."""
        makers: dict[str, Callable[[Any], Mark]] = {
            "no_go": _area,
            "walls": _line,
            "cuts": _line,
            "joins": lambda m: Join(m["name"], _point(m["one_m"]), _point(m["other_m"])),
            "rooms": lambda m: RoomName(m["name"], _point(m["at_m"])),
            "zones": _area,
        }
        if not isinstance(plain, Mapping) or not plain.keys() <= makers.keys():
            raise MapError(
                f"{name}: annotations hold {', '.join(makers)} and nothing else; correct that."
            )
        made = cls()
        for kind, make in makers.items():
            marks = plain.get(kind, [])
            if not isinstance(marks, list):
                raise MapError(f"{name}: {kind} must be a list; correct it.")
            for number, mark in enumerate(marks):
                try:
                    made = made.add(kind, make(mark))
                except (KeyError, TypeError, ValueError, OverflowError) as error:
                    if isinstance(error, MapError):
                        raise MapError(f"{name}: {error}") from None
                    raise MapError(
                        f"{name}: {kind}[{number}] is incomplete or malformed; remove it."
                    ) from None
        return made


# ---------------------------------------------------------------------- checks


def _check(kind: str, mark: Mark) -> None:
    if not isinstance(mark.name, str) or not 0 < len(mark.name) <= MAX_NAME:
        raise MapError(f"{kind}: a name has 1 to {MAX_NAME} letters; shorten {mark.name!r}.")
    if not mark.name.isprintable():
        raise MapError(f"{kind}: the name {mark.name!r} holds control characters; retype it.")
    if isinstance(mark, Area):
        points = mark.corners_m
        if not 3 <= len(points) <= MAX_CORNERS:
            raise MapError(
                f"{kind}: {mark.name} has {len(points)} corners; give 3 to {MAX_CORNERS}."
            )
    elif isinstance(mark, Line):
        points = (mark.start_m, mark.end_m)
    else:
        points = (mark.one_m, mark.other_m) if isinstance(mark, Join) else (mark.at_m,)
    if any(not math.isfinite(v) or abs(v) > FAR_M for point in points for v in point):
        raise MapError(f"{kind}: {mark.name} lies outside of {FAR_M:.0f} m; correct its numbers.")
    if isinstance(mark, Area) and _area_m2(mark.corners_m) < MIN_AREA_M2:
        raise MapError(f"{kind}: {mark.name} encloses nothing; draw it larger.")
    if isinstance(mark, Line) and math.dist(mark.start_m, mark.end_m) < MIN_LENGTH_M:
        raise MapError(f"{kind}: {mark.name} is shorter than {MIN_LENGTH_M} m; draw it longer.")


def _area_m2(corners: Sequence[Point]) -> float:
    """Gauss's area formula; 0 for a bow tie of equal wings."""
    twice = sum(
        a[0] * b[1] - b[0] * a[1] for a, b in zip(corners, [*corners[1:], corners[0]], strict=True)
    )
    return abs(twice) / 2.0


def _segment_m(x: float, y: float, a: Point, b: Point) -> float:
    dx, dy = b[0] - a[0], b[1] - a[1]
    length2 = dx * dx + dy * dy
    t = 0.0 if length2 == 0.0 else ((x - a[0]) * dx + (y - a[1]) * dy) / length2
    t = min(1.0, max(0.0, t))
    return math.hypot(x - a[0] - t * dx, y - a[1] - t * dy)


def _point(plain: Sequence[float]) -> Point:
    x, y = plain
    if isinstance(x, str | bool) or isinstance(y, str | bool):
        raise TypeError("a point is two numbers")
    return float(x), float(y)


def _line(plain: Mapping[str, Any]) -> Line:
    return Line(plain["name"], _point(plain["start_m"]), _point(plain["end_m"]))


def _area(plain: Mapping[str, Any]) -> Area:
    return Area(plain["name"], tuple(_point(point) for point in plain["corners_m"]))


def _area_dict(area: Area) -> dict[str, Any]:
    return {"name": area.name, "corners_m": [list(point) for point in area.corners_m]}


def _line_dict(line: Line) -> dict[str, Any]:
    return {"name": line.name, "start_m": list(line.start_m), "end_m": list(line.end_m)}
