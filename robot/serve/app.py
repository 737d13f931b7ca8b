"""The application: routes derived from the capabilities, behind the one gate."""

from __future__ import annotations

import asyncio
import contextlib
import mimetypes
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable
from functools import cache
from importlib.resources import files

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, Response
from starlette.routing import BaseRoute, Route, WebSocketRoute

from robot.serve.capability import PREFIX, Capability, Operation, Robot, capabilities
from robot.serve.guard.gate import Gate, Rules
from robot.serve.guard.login import login_page
from robot.serve.live import Live
from robot.serve.openapi import describe, docs_page
from robot.serve.runtime import Unreachable

Service = Callable[[], Awaitable[None]]
PAGE_FILES = (
    "app.js", "calibrate.js", "drive.js", "fan.js", "health.js", "kit.js", "map.js", "plan.js",
    "rooms.js", "sketch.js", "style.css", "icon.svg", "manifest.webmanifest",
)  # fmt: skip
mimetypes.add_type("application/manifest+json", ".webmanifest")
mimetypes.add_type("text/javascript", ".js")


def make_app(robot: Robot, rules: Rules, services: Iterable[Service] = ()) -> Gate:
    """The ASGI application; `services` live and die with it."""
    routes: list[BaseRoute] = [
        Route("/health", _health),
        Route("/", _page),
        *(Route(f"/{name}", _page_file) for name in PAGE_FILES),
        Route(f"{PREFIX}/capabilities", _listing(robot)),
        Route(f"{PREFIX}/openapi.json", _openapi(robot)),
        Route(f"{PREFIX}/docs", _docs(robot)),
        Route(f"{PREFIX}/logout", _logout(rules), methods=["POST"]),
        WebSocketRoute(f"{PREFIX}/live", Live(robot).__call__),
    ]
    for capability in capabilities():
        routes += [_route(robot, capability, operation) for operation in capability.operations]

    @contextlib.asynccontextmanager
    async def lifespan(app: Starlette) -> AsyncIterator[None]:
        tasks = [asyncio.ensure_future(service()) for service in services]
        yield
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    app = Starlette(
        routes=routes,
        lifespan=lifespan,
        exception_handlers={HTTPException: _explain, Unreachable: _unreachable},
    )
    app.router.redirect_slashes = False
    return Gate(app, rules, login_page(_text("login.html").decode()))


def shown(robot: Robot) -> list[Capability]:
    """What this robot has now."""
    return [capability for capability in capabilities() if capability.has(robot)]


# ---------------------------------------------------------------------- routes


def _route(robot: Robot, capability: Capability, operation: Operation) -> Route:
    async def answer(request: Request) -> Response:
        if not capability.has(robot):
            status = 404 if robot.world.connected else 503
            return JSONResponse({"error": f"this robot has no {capability.name} now"}, status)
        return await operation.handler(robot, request)

    return Route(f"{PREFIX}{operation.path}", answer, methods=[operation.method])


async def _health(request: Request) -> Response:
    """Open to everyone, so it says nothing else."""
    return JSONResponse({"ok": True})


async def _page(request: Request) -> Response:
    return HTMLResponse(_text("index.html"))


async def _page_file(request: Request) -> Response:
    name = request.url.path[1:]
    media = mimetypes.guess_type(name)[0] or "application/octet-stream"
    return Response(_text(name), media_type=media, headers={"cache-control": "no-cache"})


def _listing(robot: Robot) -> Callable[[Request], Awaitable[Response]]:
    async def listing(request: Request) -> Response:
        entries = [
            {
                "name": capability.name,
                "title": capability.title,
                "summary": capability.summary,
                "button": capability.button
                and {
                    "label": capability.button.label,
                    "states": sorted(capability.button.states),
                    "weight": capability.button.weight,
                    "path": PREFIX + capability.operations[0].path,
                },
            }
            for capability in shown(robot)
        ]
        return JSONResponse({"name": robot.name, "capabilities": entries})

    return listing


def _openapi(robot: Robot) -> Callable[[Request], Awaitable[Response]]:
    async def openapi(request: Request) -> Response:
        return JSONResponse(describe(shown(robot), robot.name))

    return openapi


def _docs(robot: Robot) -> Callable[[Request], Awaitable[Response]]:
    async def docs(request: Request) -> Response:
        return HTMLResponse(docs_page(shown(robot), robot.name))

    return docs


def _logout(rules: Rules) -> Callable[[Request], Awaitable[Response]]:
    async def logout(request: Request) -> Response:
        rules.keys.end_session(request.cookies.get(rules.cookie, ""))
        answer = JSONResponse({"welcome": False})
        answer.delete_cookie(rules.cookie)
        return answer

    return logout


# ---------------------------------------------------------------------- refusals


async def _explain(request: Request, error: Exception) -> Response:
    status = error.status_code if isinstance(error, HTTPException) else 500
    reason = {404: "there is no such thing", 405: "not with this method"}.get(status, str(error))
    headers = getattr(error, "headers", None)
    return JSONResponse({"error": reason}, status, headers)


async def _unreachable(request: Request, error: Exception) -> Response:
    return JSONResponse({"error": str(error)}, 503)


@cache
def _text(name: str) -> bytes:
    return files("robot.serve").joinpath("web", name).read_bytes()
