"""What a message of Home Assistant asks for: the vacuum's own words, commands, segments, fan speed.

Everything is derived from the capabilities, and a command's parameters pass the same check as the
body of the same request over REST.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any, NamedTuple

from robot.serve.capability import Capability, Operation
from robot.serve.fields import BadBody, fields, read_body, words

# Home Assistant's payload for a feature of its vacuum, where it is not the feature's own name.
VACUUM_PAYLOADS = {"return_home": "return_to_base"}
NOT_BY_MAIL = frozenset({"manual"})  # a dead man's handle needs a line that is quick
NOTHING = fields({})


class Order(NamedTuple):
    """One request to the runtime."""

    verb: str
    args: list[str]


def payload_verbs(capabilities: Iterable[Capability]) -> dict[str, str]:
    """Which request a vacuum's or a button's payload stands for."""
    verbs: dict[str, str] = {}
    for capability in capabilities:
        if capability.button:
            verbs[capability.name] = capability.name
            feature = capability.button.vacuum
            if feature:
                verbs[VACUUM_PAYLOADS.get(feature, feature)] = capability.name
    return verbs


def press(text: str, capabilities: Iterable[Capability], state: Any) -> Order:
    """The topic `command`. Raises BadBody."""
    verb = payload_verbs(capabilities).get(text.strip())
    if verb is None:
        raise BadBody("this robot has no such command")
    # Home Assistant has one button for both.
    return Order("resume" if verb == "start" and state == "paused" else verb, [])


def command(text: str, capabilities: Iterable[Capability]) -> Order:
    """The topic `send_command`: a word, or {"command": "go to", "x_m": 1, "y_m": 2}.

    Raises BadBody.
    """
    parameters: dict[str, Any] = {}
    if text.lstrip().startswith("{"):
        try:
            parameters = json.loads(text)
            text = parameters.pop("command")
        except (ValueError, KeyError, RecursionError):
            raise BadBody('a command is a word, or {"command": WORD, ...}') from None
    known = _known(capabilities)
    if not isinstance(text, str):
        raise BadBody("a command's name is a word")
    choice = known.get(text.strip().lower().replace("_", " ").replace("-", " "))
    if choice is None:
        raise BadBody(f"choose one of {', '.join(sorted(known))}")
    # Where several operations are the same verb, the parameters tell which is meant.
    operation = next((o for o in choice if _knows(o, parameters)), choice[0])
    schema = operation.body or NOTHING
    body = read_body(schema, json.dumps(parameters).encode())
    return Order(operation.verb, words(schema, body))


def segments(text: str, capabilities: Iterable[Capability]) -> Order:
    """The topic `segments`: a JSON list of rooms, as the state has told them. Raises BadBody."""
    try:
        rooms = json.loads(text)
    except (ValueError, RecursionError):
        raise BadBody("segments are a JSON list") from None
    return command(json.dumps({"command": "clean rooms", "rooms": rooms}), capabilities)


def fan_speed(text: str, capabilities: Iterable[Capability]) -> Order:
    """The topic `fan_speed`: one of the levels that were announced. Raises BadBody."""
    return command(json.dumps({"command": "fan", "level": text.strip()}), capabilities)


def _known(capabilities: Iterable[Capability]) -> dict[str, list[Operation]]:
    known: dict[str, list[Operation]] = {}
    for capability in capabilities:
        for operation in capability.operations:
            if operation.verb and operation.verb not in NOT_BY_MAIL:
                known.setdefault(operation.verb.replace("-", " "), []).append(operation)
    return known


def _knows(operation: Operation, parameters: Iterable[str]) -> bool:
    return set(parameters) <= (operation.body or NOTHING)["properties"].keys()
