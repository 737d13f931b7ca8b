"""The OpenAPI description (3.1) and its page, derived from the capabilities."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from typing import Any

from robot import __version__
from robot.serve.capability import ACCEPTED, PREFIX, Capability, Operation, Schema

ERROR: Schema = {
    "type": "object",
    "required": ["error"],
    "properties": {"error": {"type": "string"}},
}
REFUSALS = {
    400: "The request makes no sense.",
    401: "A token is needed.",
    403: "Asked from a foreign page.",
    404: "There is no such thing.",
    405: "Not with this method.",
    408: "The body did not arrive in time.",
    409: "The robot refuses; `reason` says why.",
    413: "The body is too large.",
    421: "The robot does not answer to this Host.",
    429: "Too many requests.",
    503: "The robot's runtime does not answer, or remote control is switched off.",
}
ALWAYS = (400, 401, 403, 405, 408, 413, 421, 429, 503)


def describe(capabilities: Iterable[Capability], name: str) -> dict[str, Any]:
    """The whole document."""
    paths: dict[str, dict[str, Any]] = {}
    for capability in capabilities:
        for operation in capability.operations:
            path = paths.setdefault(operation.path, {})
            path[operation.method.lower()] = _operation(capability, operation)
    return {
        "openapi": "3.1.0",
        "info": {"title": name, "version": __version__, "description": "A robot vacuum's API."},
        "servers": [{"url": PREFIX}],
        "security": [{"token": []}, {"session": []}],
        "paths": paths,
        "components": {
            "securitySchemes": {
                "token": {"type": "http", "scheme": "bearer"},
                "session": {"type": "apiKey", "in": "cookie", "name": "sweeper"},
            }
        },
    }


def _operation(capability: Capability, operation: Operation) -> dict[str, Any]:
    schema = operation.answer or {"type": "string", "format": "binary"}
    answers: dict[str, Any] = {
        "200": {"description": "Done.", "content": {operation.media: {"schema": schema}}}
    }
    for status in sorted({*ALWAYS, *operation.refusals}):
        wanted = ACCEPTED if status == 409 else ERROR
        content = {"application/json": {"schema": wanted}}
        answers[str(status)] = {"description": REFUSALS[status], "content": content}
    described: dict[str, Any] = {
        "operationId": f"{operation.method.lower()}_{capability.name}_{_slug(operation.path)}",
        "tags": [capability.name],
        "summary": operation.summary,
        "description": capability.summary,
        "parameters": [
            {
                "name": parameter.name,
                "in": parameter.where,
                "required": parameter.where == "path",
                "description": parameter.summary,
                "schema": parameter.schema,
            }
            for parameter in operation.parameters
        ],
        "responses": answers,
    }
    if operation.body is not None:
        content = {"application/json": {"schema": operation.body}}
        needed = bool(operation.body["required"])
        described["requestBody"] = {"required": needed, "content": content}
    return described


def _slug(path: str) -> str:
    return "".join(c if c.isalnum() else "_" for c in path).strip("_")


def docs_page(capabilities: Iterable[Capability], name: str) -> str:
    """The same for people, without a line of script."""
    sections = "".join(_section(capability) for capability in capabilities)
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<title>{escape(name)}: API</title><link rel="stylesheet" href="/style.css"></head>'
        f'<body class="docs"><main><h1>{escape(name)}: API</h1><p>Every request needs '
        "<code>Authorization: Bearer TOKEN</code>; <code>sweeper serve --new-token NAME</code> "
        f'makes one. Machine-readable: <a href="{PREFIX}/openapi.json">openapi.json</a>. '
        f'Live: a WebSocket at <code>{PREFIX}/live</code>. <a href="/">Back to the robot</a></p>'
        f"{sections}</main></body></html>"
    )


def _needs(operation: Operation) -> str:
    """What the body holds, in words."""
    if operation.body is None:
        return ""
    required = operation.body["required"]
    names = [
        f"<code>{escape(name)}</code>{'' if name in required else ' (optional)'}"
        for name in operation.body["properties"]
    ]
    return f"<br>Body: {', '.join(names)}"


def _section(capability: Capability) -> str:
    rows = "".join(
        f"<li><code>{operation.method} {PREFIX}{escape(operation.path)}</code> "
        f"{escape(operation.summary)}{_needs(operation)}</li>"
        for operation in capability.operations
    )
    return (
        f"<section><h2>{escape(capability.title)}</h2><p>{escape(capability.summary)}</p>"
        f"<ul>{rows}</ul></section>"
    )
