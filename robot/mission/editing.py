"""Requests that change what is drawn on the map, or tell what is."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

from robot.errors import MapError
from robot.mapping.annotations import Annotations, Area, Join, Line, RoomName
from robot.mapping.named_rooms import Rooms, room_at, splits
from robot.mapping.outlines import outline_m
from robot.mission.state import Situation
from robot.mission.verbs import is_number, numbers


class Reply(NamedTuple):
    """What becomes of a request; `data` is JSON text."""

    accepted: bool
    reason: str
    data: str = ""


Args = tuple[str, ...]
NEEDS_ROOMS = frozenset({"rooms", "room split", "room join", "room name", "clean rooms"})


def edit(verb: str, args: Args, now: Situation, rooms: Rooms | None) -> Reply:
    """Carry out one verb of the table whose place is "map"; `rooms` for those that need them."""
    try:
        if verb in NEEDS_ROOMS:
            assert rooms is not None
            return _ROOMS[verb](args, now, rooms)
        return _DRAWINGS[verb](args, now)
    except MapError as error:
        return Reply(False, str(error))


# ---------------------------------------------------------------------- areas, walls, zones


def drawn_area(name: str, values: Sequence[float]) -> Area:
    """A rectangle of two opposite corners, or a polygon. Raises MapError for other numbers."""
    if len(values) < 4 or len(values) % 2:
        raise MapError("give x y of two opposite corners, or x y of three corners and more")
    points = list(zip(values[::2], values[1::2], strict=True))
    if len(points) == 2:
        (x0, y0), (x1, y1) = points
        points = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
    return Area(name, tuple(points))


def _add_area(args: Args, now: Situation) -> Reply:
    drawn = now.notes.current
    area = drawn_area(drawn.free_name("no_go", "area"), numbers(args))
    return _drawn(now, drawn.add("no_go", area), area.name)


def _add_zone(args: Args, now: Situation) -> Reply:
    name, drawn = args[0], now.notes.current
    if is_number(name):
        return Reply(False, f"a zone cannot be called {name}: that is a number; take a name")
    now.notes.change(drawn.add("zones", drawn_area(name, numbers(args[1:]))))
    return Reply(True, f"`clean zones` knows {name!r} now", json.dumps({"name": name}))


def _add_wall(args: Args, now: Situation) -> Reply:
    x0, y0, x1, y1 = numbers(args)
    drawn = now.notes.current
    wall = Line(drawn.free_name("walls", "wall"), (x0, y0), (x1, y1))
    return _drawn(now, drawn.add("walls", wall), wall.name)


def _drawn(now: Situation, new: Annotations, name: str) -> Reply:
    """Let it hold, unless it would catch the robot or its dock."""
    for what, place in (("the robot", now.pose), ("the dock", now.sight.world_from_docked)):
        if place is None:
            continue
        away_m = new.distance_m(place.x_m, place.y_m)
        least_m = now.robot.radius_m + now.config.no_go_margin_m
        if away_m < least_m and away_m < now.notes.current.distance_m(place.x_m, place.y_m):
            return Reply(False, f"it would catch {what}, which stands {away_m:.2f} m from it")
    now.notes.change(new)
    return Reply(True, f"drawn as {name!r}", json.dumps({"name": name}))


def _remove(kind: str) -> Callable[[Args, Situation], Reply]:
    def remove(args: Args, now: Situation) -> Reply:
        now.notes.change(now.notes.current.remove(kind, " ".join(args)))
        return Reply(True, f"{' '.join(args)!r} is gone")

    return remove


# ---------------------------------------------------------------------- history


def _show(args: Args, now: Situation) -> Reply:
    drawn = now.notes.current
    said = ", ".join(
        f"{len(marks)} {word}{'' if len(marks) == 1 else 's'}"
        for marks, word in (
            (drawn.no_go, "no-go area"),
            (drawn.walls, "virtual wall"),
            (drawn.cuts, "cut"),
            (drawn.joins, "join"),
            (drawn.rooms, "named room"),
            (drawn.zones, "zone"),
        )
    )
    data = {"annotations": drawn.to_dict(), "snapshots": now.notes.snapshots}
    return Reply(True, said, json.dumps(data))


def _undo(args: Args, now: Situation) -> Reply:
    now.notes.undo()
    return Reply(True, "the last change was taken back")


def _keep(args: Args, now: Situation) -> Reply:
    now.notes.keep(args[0])
    return Reply(True, f"kept as {args[0]!r}")


def _restore(args: Args, now: Situation) -> Reply:
    now.notes.restore(args[0])
    return Reply(True, f"{args[0]!r} holds again")


# ---------------------------------------------------------------------- rooms


def _list(args: Args, now: Situation, rooms: Rooms) -> Reply:
    listed = [
        {
            "name": name,
            "area_m2": round(rooms.area_m2(i), 2),
            "at_m": _rounded(rooms, i),
            "outline_m": outline_m(rooms, i),
        }
        for i, name in enumerate(rooms.names, 1)
    ]
    if not listed:
        return Reply(True, "no room is known yet; let the robot clean once", '{"rooms": []}')
    said = ", ".join(f"{room['name']} ({room['area_m2']} m2)" for room in listed)
    return Reply(True, said, json.dumps({"rooms": listed}))


def _split(args: Args, now: Situation, rooms: Rooms) -> Reply:
    x0, y0, x1, y1 = numbers(args)
    drawn = now.notes.current
    cut = Line(drawn.free_name("cuts", "cut"), (x0, y0), (x1, y1))
    new = drawn.add("cuts", cut)
    if not splits(rooms.grid, rooms.labels, cut.start_m, cut.end_m):
        return Reply(False, "the line divides no room; draw it from wall to wall")
    now.notes.change(new)
    return Reply(True, "the room is two now")


def _join(args: Args, now: Situation, rooms: Rooms) -> Reply:
    one, other = rooms.number(args[0]), rooms.number(args[1])
    if one == other:
        return Reply(False, "that is one room already; name two")
    drawn = now.notes.current
    join = Join(drawn.free_name("joins", "join"), rooms.middle_m(one), rooms.middle_m(other))
    now.notes.change(drawn.add("joins", join))
    return Reply(True, f"{rooms.names[one - 1]} and {rooms.names[other - 1]} are one room now")


def _name(args: Args, now: Situation, rooms: Rooms) -> Reply:
    number, name = rooms.number(args[0]), args[1]
    drawn = now.notes.current
    for mark in drawn.rooms:  # the names that this room or another one has had
        if mark.name.casefold() == name.casefold():
            if room_at(rooms.grid, rooms.labels, mark.at_m) not in (0, number):
                return Reply(False, f"another room is called {name!r} already; take another name")
            drawn = drawn.remove("rooms", mark.name)
        elif room_at(rooms.grid, rooms.labels, mark.at_m) == number:
            drawn = drawn.remove("rooms", mark.name)
    now.notes.change(drawn.add("rooms", RoomName(name, rooms.middle_m(number))))
    return Reply(True, f"{args[0]} is called {name} now")


def _rounded(rooms: Rooms, number: int) -> list[float]:
    return [round(v, 2) for v in rooms.middle_m(number) if math.isfinite(v)]


_DRAWINGS: dict[str, Callable[[Args, Situation], Reply]] = {
    "no-go add": _add_area,
    "no-go remove": _remove("no_go"),
    "wall add": _add_wall,
    "wall remove": _remove("walls"),
    "zone add": _add_zone,
    "zone remove": _remove("zones"),
    "map show": _show,
    "map undo": _undo,
    "map snapshot": _keep,
    "map restore": _restore,
}
_ROOMS: dict[str, Callable[[Args, Situation, Rooms], Reply]] = {
    "rooms": _list,
    "room split": _split,
    "room join": _join,
    "room name": _name,
}
