"""What a capability is: declared once, and REST, OpenAPI, the page, MQTT and the docs follow.

A capability is one small file in `robot/serve/capabilities` with one constant, `CAPABILITY`. It is
shown only while the robot has it (`has`).
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from robot.serve.fields import BadBody, Schema, fields, read_body, words
from robot.serve.runs import NO_RING, Ring

if TYPE_CHECKING:
    from robot.serve.runs import Runs
    from robot.serve.runtime import Runtime
    from robot.serve.world import World

PREFIX = "/api/v1"
FAN_LEVELS = ("off", "low", "medium", "high")


@dataclass(frozen=True)
class Robot:
    """All that a capability may use."""

    runtime: Runtime
    world: World
    runs: Runs
    name: str
    robot_id: str
    fleet: Mapping[str, dict[str, Any]] = field(default_factory=dict)
    has_fleet: bool = False
    config: Path | None = None  # the runtime's settings, for the support bundle
    ring: Ring = NO_RING
    installed: Path = Path("/opt/sweeper")  # where releases are, if it was installed


Handler = Callable[[Robot, Request], Awaitable[Response]]


@dataclass(frozen=True, slots=True)
class Parameter:
    """Of the path or the query; a query's is always optional."""

    name: str
    summary: str
    schema: Schema
    where: Literal["path", "query"] = "path"


@dataclass(frozen=True, slots=True)
class Operation:
    """One REST operation below `PREFIX`."""

    method: Literal["GET", "POST"]
    path: str
    summary: str
    handler: Handler
    answer: Schema | None = None  # of JSON
    media: str = "application/json"
    parameters: tuple[Parameter, ...] = ()
    refusals: tuple[int, ...] = ()  # beside 400, 401, 403, 413, 421, 429
    body: Schema | None = None  # of JSON
    verb: str = ""  # of the runtime, if it hands one over


@dataclass(frozen=True, slots=True)
class Button:
    """How the page and Home Assistant show a request."""

    label: str
    states: frozenset[str]  # of the mission, in which it makes sense
    weight: Literal["main", "plain", "danger"] = "plain"
    vacuum: str = ""  # Home Assistant's feature of a vacuum, if it has one for this
    icon: str = ""  # Material Design's name, for Home Assistant


@dataclass(frozen=True, slots=True)
class Sensor:
    """One value for Home Assistant: a component, and its settings over the state's JSON."""

    component: str  # sensor, binary_sensor, image
    settings: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Capability:
    """Something the robot can do or show."""

    name: str
    title: str
    summary: str
    operations: tuple[Operation, ...]
    has: Callable[[Robot], bool] = lambda robot: True
    button: Button | None = None
    sensors: Mapping[str, Sensor] = field(default_factory=dict)


RESTING = frozenset({"none", "idle", "docked", "done", "error", "charge", "manual"})
ACTIVE = frozenset(
    {
        "starting", "undock", "look", "clean", "spot", "zone", "room", "goto", "return", "dock",
        "recover", "retrace", "lost", "wheel-only",
    }
)  # fmt: skip
ANY = RESTING | ACTIVE | {"paused", "lifted"}
ACCEPTED: Schema = {
    "type": "object",
    "required": ["accepted", "reason"],
    "properties": {"accepted": {"type": "boolean"}, "reason": {"type": "string"}},
}


def verb_operation(
    verb: str,
    path: str,
    summary: str,
    properties: Mapping[str, Schema] | None = None,
    optional: Sequence[str] = (),
) -> Operation:
    """Hands one verb to the runtime; `properties` are its arguments, in the verb's order."""
    schema = fields(properties or {}, optional)

    async def ask(robot: Robot, request: Request) -> Response:
        try:
            arguments = words(schema, read_body(schema, await request.body()))
        except BadBody as error:
            return JSONResponse({"error": str(error)}, 400)
        answer = await robot.runtime.request(verb, arguments)
        told = {"accepted": answer["accepted"], "reason": answer["reason"]}
        return JSONResponse(told, 200 if answer["accepted"] else 409)

    body = schema if properties else None
    refusals = (409, 503)
    return Operation("POST", path, summary, ask, ACCEPTED, refusals=refusals, body=body, verb=verb)


def listing_operation(verb: str, path: str, summary: str, answer: Schema) -> Operation:
    """Tells what the runtime has to list under a verb."""

    async def read(robot: Robot, request: Request) -> Response:
        told = await robot.runtime.request(verb)
        if not told["accepted"]:
            return JSONResponse({"accepted": False, "reason": told["reason"]}, 409)
        return JSONResponse({"reason": told["reason"], **told["data"]})

    return Operation("GET", path, summary, read, answer, refusals=(409, 503))


def listed(**lists: Schema) -> Schema:
    """The schema of a listing: a sentence, and more."""
    return {
        "type": "object",
        "required": ["reason", *lists],
        "properties": {"reason": {"type": "string"}, **lists},
    }


def request_capability(
    verb: str,
    title: str,
    summary: str,
    button: Button,
    properties: Mapping[str, Schema] | None = None,
) -> Capability:
    """A capability that is one verb with a button; all its arguments are optional."""
    operation = verb_operation(verb, f"/{verb}", summary, properties, tuple(properties or ()))
    return Capability(verb, title, summary, (operation,), has_verbs(verb), button)


def has_verbs(*verbs: str) -> Callable[[Robot], bool]:
    """Shown while the robot knows all of these."""
    return lambda robot: all(robot.world.has(verb) for verb in verbs)


@cache
def capabilities() -> tuple[Capability, ...]:
    """Everything that is declared, by name of its file."""
    from robot.serve import capabilities as folder

    names = sorted(module.name for module in pkgutil.iter_modules(folder.__path__))
    found = [importlib.import_module(f"{folder.__name__}.{name}").CAPABILITY for name in names]
    return tuple(found)
