"""Schemas that make a log readable by others: JSON Schema and protobuf descriptors."""

from __future__ import annotations

import dataclasses
import types
import typing
from typing import Any

import msgspec
import numpy as np

_SCALARS: dict[Any, str] = {
    float: "number",
    int: "integer",
    bool: "boolean",
    str: "string",
    bytes: "string",
}


def json_schema(kind: type) -> bytes:
    """JSON Schema of a message as `robot.log.codec` writes it.

    Shallow on purpose (nested records are just objects): viewers need to know what is a number,
    and several of them stumble over null where a nested schema promises fields.
    """
    hints = typing.get_type_hints(kind)
    properties: dict[str, dict[str, Any]] = {
        f.name: {"type": _json_type(hints[f.name])} for f in dataclasses.fields(kind)
    }
    for name, schema in properties.items():
        if schema["type"] == "array":
            schema["items"] = {"type": _json_type(typing.get_args(hints[name])[0])}
    return msgspec.json.encode(
        {
            "title": f"sweeper.{kind.__name__}",
            "description": " ".join((kind.__doc__ or "").split()),
            "type": "object",
            "properties": properties,
        }
    )


def _json_type(hint: Any) -> str:
    if hint in _SCALARS:
        return _SCALARS[hint]
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is typing.Literal:
        return "string"
    if origin is tuple:
        return "array"
    if origin in (typing.Union, types.UnionType):
        return _json_type(arguments[0])
    if hint is np.ndarray or origin is dict or dataclasses.is_dataclass(hint):
        return "object"
    raise TypeError(f"no JSON type for {hint}")


def protobuf_schema(message_type: Any) -> bytes:
    """Serialized FileDescriptorSet of a protobuf message class, with all that it imports."""
    from google.protobuf.descriptor_pb2 import FileDescriptorSet

    files: dict[str, Any] = {}

    def visit(descriptor: Any) -> None:
        for dependency in descriptor.dependencies:
            visit(dependency)
        files.setdefault(descriptor.name, descriptor)

    visit(message_type.DESCRIPTOR.file)
    result = FileDescriptorSet()
    for descriptor in files.values():
        descriptor.CopyToProto(result.file.add())
    return bytes(result.SerializeToString())
