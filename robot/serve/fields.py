"""Bodies of requests: their JSON Schema, its check, and the words of the control socket.

A capability says once what a request needs, as properties in the order of the verb's arguments.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

Schema = dict[str, Any]

METRES: Schema = {"type": "number", "minimum": -1000, "maximum": 1000}
NAME: Schema = {"type": "string", "minLength": 1, "maxLength": 40}


class BadBody(ValueError):
    """The body is not what the description says; the text is for people."""


def many(items: Schema, least: int, most: int) -> Schema:
    """A list of between `least` and `most` items."""
    return {"type": "array", "items": items, "minItems": least, "maxItems": most}


def fields(properties: Mapping[str, Schema], optional: Sequence[str] = ()) -> Schema:
    """An object with these properties, in the order of the verb's arguments."""
    return {
        "type": "object",
        "properties": dict(properties),
        "required": [name for name in properties if name not in optional],
        "additionalProperties": False,
    }


def read_body(schema: Schema, data: bytes) -> dict[str, Any]:
    """The body as an object that fits the schema; no body is an empty one. Raises BadBody."""
    try:
        body = json.loads(data) if data.strip() else {}
    except (ValueError, RecursionError):
        raise BadBody("the body is no JSON") from None
    _check("the body", schema, body)
    return dict(body)


def words(schema: Schema, body: Mapping[str, Any]) -> list[str]:
    """The verb's arguments: numbers and texts one after the other, lists laid flat."""
    return [word for name in schema["properties"] if name in body for word in _flat(body[name])]


def _flat(value: Any) -> list[str]:
    if isinstance(value, list):
        return [word for item in value for word in _flat(item)]
    return [value] if isinstance(value, str) else [repr(round(float(value), 4))]


def _check(name: str, schema: Schema, value: Any) -> None:
    _CHECKS[schema["type"]](name, schema, value)


def _object(name: str, schema: Schema, value: Any) -> None:
    if not isinstance(value, dict):
        raise BadBody(f"{name} must be an object")
    properties = schema["properties"]
    if unknown := value.keys() - properties.keys():
        known = ", ".join(properties) or "nothing"
        raise BadBody(f"{name} has {min(unknown)[:40]!r}, but knows {known}")
    for key in schema["required"]:
        if key not in value:
            raise BadBody(f"{name} lacks {key}")
    for key, item in value.items():
        _check(key, properties[key], item)


def _array(name: str, schema: Schema, value: Any) -> None:
    least, most = schema["minItems"], schema["maxItems"]
    if not isinstance(value, list) or not least <= len(value) <= most:
        raise BadBody(f"{name} must be a list of {least} to {most}")
    for item in value:
        _check(name, schema["items"], item)


def _number(name: str, schema: Schema, value: Any) -> None:
    low, high = schema["minimum"], schema["maximum"]
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not number or not math.isfinite(value) or not low <= value <= high:
        raise BadBody(f"{name} must be a number from {low} to {high}")


def _integer(name: str, schema: Schema, value: Any) -> None:
    _number(name, schema, value)
    if value != int(value):
        raise BadBody(f"{name} must be a whole number")


def _string(name: str, schema: Schema, value: Any) -> None:
    if "enum" in schema and value not in schema["enum"]:
        raise BadBody(f"{name} must be one of {', '.join(schema['enum'])}")
    least, most = schema.get("minLength", 0), schema.get("maxLength", 200)
    if not isinstance(value, str) or not least <= len(value) <= most or not value.isprintable():
        raise BadBody(f"{name} must be a printable text of {least} to {most} letters")


_CHECKS = {
    "object": _object,
    "array": _array,
    "number": _number,
    "integer": _integer,
    "string": _string,
}
