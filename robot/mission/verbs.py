"""What can be asked of the robot: every verb, its arguments and its manual, in one table.

The command line, the control socket, the dashboard and the schedule all read this table. A verb may
be several words ("clean rooms"); hyphens do as well ("clean-rooms"). Coordinates are metres of the
map: the docked robot stands at 0 0 and looks along x.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from robot.errors import RequestError

MAX_ARGUMENTS = 200
MAX_NUMBER = 1000.0
Kind = Literal["number", "text"]


@dataclass(frozen=True, slots=True)
class Argument:
    """One argument; `many`: one or more of it; optional ones stand last."""

    name: str
    kind: Kind
    summary: str
    optional: bool = False
    many: bool = False


@dataclass(frozen=True, slots=True)
class Verb:
    """`place` says who answers: the mission, the map's editor, or the runtime's own books."""

    name: str
    summary: str
    arguments: tuple[Argument, ...] = ()
    place: Literal["mission", "map", "books"] = "mission"

    @property
    def usage(self) -> str:
        """The verb with its arguments, as a manual prints it."""
        words = [self.name]
        for argument in self.arguments:
            word = argument.name.upper() + (" ..." if argument.many else "")
            words.append(f"[{word}]" if argument.optional else word)
        return " ".join(words)

    def as_dict(self) -> dict[str, Any]:
        """For programs: plain texts and lists."""
        return {
            "name": self.name,
            "summary": self.summary,
            "place": self.place,
            "arguments": [
                {
                    "name": argument.name,
                    "kind": argument.kind,
                    "summary": argument.summary,
                    "optional": argument.optional,
                    "many": argument.many,
                }
                for argument in self.arguments
            ],
        }


def _point(name: str, what: str) -> tuple[Argument, Argument]:
    return (
        Argument(f"{name}x_m", "number", f"x of {what}"),
        Argument(f"{name}y_m", "number", f"y of {what}"),
    )


_NAME = Argument("name", "text", "its name")
_ROOM = Argument("room", "text", "a room's name, as `rooms` lists it")
_CORNERS = Argument(
    "corner_m",
    "number",
    "x y x y: two opposite corners; or x y of three and more",
    many=True,
)
_LINE = (*_point("", "its beginning"), *_point("end_", "its end"))

VERBS: tuple[Verb, ...] = (
    Verb("start", "clean the whole home"),
    Verb("pause", "stand still until resume"),
    Verb("resume", "go on after a pause"),
    Verb("stop", "end the run and stand still"),
    Verb("dock", "go back to the dock"),
    Verb("locate", "beep, so that the robot can be found"),
    Verb(
        "spot",
        "clean the place where the robot is",
        (Argument("side_m", "number", "side of the square, default 1.5", optional=True),),
    ),
    Verb("clean rooms", "clean only these rooms", (Argument("room", "text", "name", many=True),)),
    Verb(
        "clean zones",
        "clean only these zones",
        (Argument("zone", "text", "its name; or x y x y, opposite corners of each", many=True),),
    ),
    Verb("go to", "drive to a place and wait there", _point("", "the place")),
    Verb(
        "manual",
        "drive by hand; ask again within 200 ms, or the robot stops",
        (
            Argument("v_mps", "number", "speed, negative: backwards"),
            Argument("yaw_rate_radps", "number", "turn rate, positive: left"),
        ),
    ),
    Verb(
        "fan",
        "how hard the fan works from now on; without a level: tell it",
        (Argument("level", "text", "off, low, medium or high", optional=True),),
    ),
    Verb("rooms", "list the rooms with their names", place="map"),
    Verb("room split", "cut a room along a line", _LINE, "map"),
    Verb("room join", "make two rooms one", (_ROOM, Argument("other", "text", "another")), "map"),
    Verb("room name", "give a room a name", (_ROOM, _NAME), "map"),
    Verb("no-go add", "draw an area that the robot stays out of", (_CORNERS,), "map"),
    Verb("no-go remove", "take such an area away", (_NAME,), "map"),
    Verb("wall add", "draw a virtual wall", _LINE, "map"),
    Verb("wall remove", "take a virtual wall away", (_NAME,), "map"),
    Verb("zone add", "draw a zone that can be cleaned by its name", (_NAME, _CORNERS), "map"),
    Verb("zone remove", "take a zone away", (_NAME,), "map"),
    Verb("map show", "list all that is drawn on the map", place="map"),
    Verb("map undo", "take the last change of the drawings back", place="map"),
    Verb("map snapshot", "keep the drawings under a name", (_NAME,), "map"),
    Verb("map restore", "let kept drawings hold again", (_NAME,), "map"),
    Verb("schedule list", "list when the robot cleans by itself", place="books"),
    Verb(
        "schedule add",
        "clean every week",
        (
            Argument("days", "text", "such as mon,wed,fri or daily"),
            Argument("time", "text", "such as 09:30"),
            Argument("words", "text", "the request, default: start", optional=True, many=True),
        ),
        "books",
    ),
    Verb(
        "schedule remove",
        "take an entry out",
        (Argument("number", "number", "as `schedule list` counts"),),
        "books",
    ),
    Verb("consumables", "hours of brush, filter and sensors since their last care", (), "books"),
    Verb(
        "consumables reset",
        "begin to count anew after care",
        (Argument("part", "text", "brush, filter or sensors"),),
        "books",
    ),
    Verb("calibration show", "how far the calibration of the cameras is", (), "books"),
    Verb(
        "calibration begin",
        "look for a calibration board in the cameras' pictures, at rest",
        (Argument("board", "text", "such as charuco:9x6:24mm, its default", optional=True),),
        "books",
    ),
    Verb("calibration save", "keep the calibration that was found", (), "books"),
    Verb("calibration end", "look for the board no more", (), "books"),
    Verb(
        "history",
        "the last runs",
        (Argument("count", "number", "how many, default 10", optional=True),),
        "books",
    ),
)
_BY_SLUG = {verb.name.replace(" ", "-"): verb for verb in VERBS}
_MOST_WORDS = max(len(verb.name.split()) for verb in VERBS)


def understand(words: Sequence[str]) -> tuple[Verb, tuple[str, ...]]:
    """The verb that the words begin with, and its arguments, checked.

    Raises RequestError with the choices or the usage.
    """
    if len(words) > MAX_ARGUMENTS:
        raise RequestError(f"a request has at most {MAX_ARGUMENTS} words; send less at once.")
    for count in range(min(_MOST_WORDS, len(words)), 0, -1):
        verb = _BY_SLUG.get("-".join(words[:count]).strip().lower().replace(" ", "-"))
        if verb is not None:
            return verb, _checked(verb, tuple(words[count:]))
    said = " ".join(words[:2])[:40]
    raise RequestError(
        f"unknown verb {said!r}; choose one of {', '.join(verb.name for verb in VERBS)}."
    )


def numbers(texts: Sequence[str]) -> list[float]:
    """Arguments of kind "number", after `understand`."""
    return [float(text) for text in texts]


def _checked(verb: Verb, given: tuple[str, ...]) -> tuple[str, ...]:
    least = sum(not argument.optional for argument in verb.arguments)
    endless = any(argument.many for argument in verb.arguments)
    if len(given) < least or (len(given) > len(verb.arguments) and not endless):
        raise RequestError(f"usage: {verb.usage}.")
    for position, text in enumerate(given):
        argument = verb.arguments[min(position, len(verb.arguments) - 1)]
        if argument.kind == "number" and not is_number(text):
            raise RequestError(
                f"{argument.name} must be a number, not {text[:40]!r}; usage: {verb.usage}."
            )
        if not text.strip():
            raise RequestError(f"{argument.name} is empty; usage: {verb.usage}.")
    return given


def is_number(text: str) -> bool:
    """Whether a text is one, finite and not absurd."""
    try:
        return math.isfinite(value := float(text)) and abs(value) <= MAX_NUMBER
    except ValueError:
        return False
