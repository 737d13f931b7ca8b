"""The one gate that every request passes, before any route is looked up. Default deny.

In this order: the local switch, the rate, the Host (DNS rebinding), the Origin (foreign pages and
foreign WebSockets), the key, the size of the body. Only `/health` needs no key.
"""

from __future__ import annotations

import asyncio
import base64
import binascii
import ipaddress
from dataclasses import dataclass, field
from http.cookies import CookieError, SimpleCookie
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

from starlette.requests import ClientDisconnect
from starlette.responses import HTMLResponse, JSONResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from robot.serve.guard.keys import SESSION_S, Keyring
from robot.serve.guard.limits import BODY_S, MAX_BODY_BYTES, Buckets
from robot.serve.guard.login import LoginPage

OPEN = frozenset({"/health"})
SAFE = frozenset({"GET", "HEAD", "OPTIONS"})
LOOPBACK = ("127.0.0.1", "localhost", "::1")
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
    "connect-src 'self'; manifest-src 'self'; frame-ancestors 'none'; base-uri 'none'; "
    "form-action 'none'"
)
HEADERS = {
    b"content-security-policy": POLICY.encode(),
    b"x-content-type-options": b"nosniff",
    b"referrer-policy": b"no-referrer",
    b"x-frame-options": b"DENY",
    b"cross-origin-opener-policy": b"same-origin",
    b"cross-origin-resource-policy": b"same-origin",
}


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


class BodyError(Exception):
    """The body is too large or too slow."""

    def __init__(self, status: int, reason: str) -> None:
        super().__init__(reason)
        self.status, self.reason = status, reason


@dataclass
class Rules:
    """What the gate lets in."""

    keys: Keyring
    hosts: frozenset[str]  # names without a port
    cookie: str = "sweeper"
    any_address: bool = False  # a bare IP address is let in: no name, no rebinding
    secure: bool = False  # cookies over TLS only
    off: Path | None = None  # while this file exists, nobody comes in
    requests: Buckets = field(default_factory=lambda: Buckets(rate=40.0, burst=160.0))
    failures: Buckets = field(default_factory=lambda: Buckets(rate=0.2, burst=10.0))

    def answers_to(self, name: str) -> bool:
        """Whether this robot may be called so."""
        return name in self.hosts or (self.any_address and _is_address(name))


class Gate:
    """ASGI middleware around everything."""

    def __init__(self, app: ASGIApp, rules: Rules, login: LoginPage) -> None:
        self._app, self._rules, self._login = app, rules, login

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let the request through, or answer it."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        answer = await self._judge(scope)
        if answer is None and scope["type"] == "websocket":
            await self._app(scope, receive, send)
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008})  # the client sees a 403
        elif answer is None:
            await self._limited(scope, receive, _dressed(send))
        else:
            await answer(scope, receive, _dressed(send))

    # ------------------------------------------------------------------ the judgement

    async def _judge(self, scope: Scope) -> Response | None:
        """None: come in. Otherwise the refusal."""
        rules, path = self._rules, scope["path"]
        headers = {k.lower(): v.decode("latin-1") for k, v in scope["headers"]}
        client = scope["client"][0] if scope.get("client") else "local"
        if not rules.requests.take(client):
            wait = str(int(rules.requests.wait_s(client)) + 1)
            return _refuse(429, "too many requests; wait a little", {"retry-after": wait})
        host = headers.get(b"host", "")
        if not rules.answers_to(_hostname(host)):
            return _refuse(421, f"this robot does not answer to the name {_hostname(host)!r}")
        if path in OPEN:
            return None
        if rules.off is not None and rules.off.exists():
            return _refuse(503, "remote control is switched off at the robot")
        origin = headers.get(b"origin")
        if origin is not None and not self._own(origin, host):
            return _refuse(403, "requests from other pages are not answered")
        unsafe = scope["type"] == "websocket" or scope["method"] not in SAFE
        if unsafe and headers.get(b"sec-fetch-site", "same-origin") not in ("same-origin", "none"):
            return _refuse(403, "requests from other pages are not answered")
        return await self._known(scope, headers, client, by_cookie=not unsafe or bool(origin))

    def _own(self, origin: str, host: str) -> bool:
        """Whether a page of this very server is asking."""
        try:
            parts = urlsplit(origin)
            name = parts.hostname or ""
        except ValueError:
            return False
        return (
            parts.scheme in ("http", "https")
            and parts.netloc == host
            and (name in self._rules.hosts)
        )

    async def _known(
        self, scope: Scope, headers: dict[bytes, str], client: str, *, by_cookie: bool
    ) -> Response | None:
        rules = self._rules
        cookie = _cookie(headers.get(b"cookie", ""), rules.cookie)
        if by_cookie and cookie and rules.keys.admits_session(cookie):
            return None
        scheme, _, secret = headers.get(b"authorization", "").partition(" ")
        link = _query_token(scope)
        if not (secret or link):
            return self._unknown(headers)
        rules.failures.take(client, 0.0)  # let time pass
        if rules.failures.wait_s(client) > 0.0:
            return _refuse(429, "too many wrong keys; wait a minute", {"retry-after": "60"})
        if scheme.lower() == "bearer" and rules.keys.admits(secret):
            return None
        if link and rules.keys.admits(link):
            return self._welcome(RedirectResponse("/", 303))
        password = _basic_password(secret) if scheme.lower() == "basic" else None
        if password is not None and await asyncio.to_thread(rules.keys.admits_password, password):
            # For the page's own form; a program that sends a password again needs no session.
            return self._welcome(JSONResponse({"welcome": True})) if scope["path"] == "/" else None
        rules.failures.take(client)
        return self._unknown(headers)

    def _welcome(self, answer: Response) -> Response:
        answer.set_cookie(
            self._rules.cookie,
            self._rules.keys.new_session(),
            max_age=SESSION_S,
            httponly=True,
            secure=self._rules.secure,
            samesite="strict",
        )
        return answer

    def _unknown(self, headers: dict[bytes, str]) -> Response:
        how = {"www-authenticate": 'Bearer realm="sweeper"', "cache-control": "no-store"}
        if "text/html" in headers.get(b"accept", ""):
            policy = {"content-security-policy": self._login.policy}
            return HTMLResponse(self._login.html, 401, {**how, **policy})
        return _refuse(401, "a token is needed: Authorization: Bearer TOKEN", how)

    # ------------------------------------------------------------------ the body

    async def _limited(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on, but give up on a body that is too long or too slow."""
        length = dict(scope["headers"]).get(b"content-length", b"0")
        if not length.isdigit() or int(length[:12]) > MAX_BODY_BYTES or len(length) > 12:
            await _too_large()(scope, receive, send)
            return
        started = False
        left = MAX_BODY_BYTES
        whole = False

        async def limited() -> Message:
            nonlocal left, whole
            if whole:
                return await receive()
            try:
                message = await asyncio.wait_for(receive(), BODY_S)
            except TimeoutError:
                raise BodyError(408, "the body did not arrive") from None
            whole = not message.get("more_body", False)
            left -= len(message.get("body", b""))
            if left < 0:
                raise BodyError(413, f"a body may have {MAX_BODY_BYTES} bytes")
            return message

        async def noted(message: Message) -> None:
            nonlocal started
            started = True
            await send(message)

        try:
            await self._app(scope, limited, noted)
        except BodyError as error:
            if not started:
                closing = {"connection": "close"}
                await _refuse(error.status, error.reason, closing)(scope, receive, send)
        except ClientDisconnect:
            return


# ---------------------------------------------------------------------- parts


def _refuse(status: int, reason: str, headers: dict[str, str] | None = None) -> Response:
    return JSONResponse({"error": reason}, status, headers)


def _too_large() -> Response:
    reason = f"a body may have {MAX_BODY_BYTES} bytes"
    return _refuse(413, reason, {"connection": "close"})


def _dressed(send: Send) -> Send:
    """Add the safety headers to every answer."""

    async def dressed(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers: list[tuple[bytes, bytes]] = list(message.get("headers", []))
            given = {name.lower() for name, _ in headers}
            headers += [(k, v) for k, v in HEADERS.items() if k not in given]
            if b"cache-control" not in given:
                headers.append((b"cache-control", b"no-store"))
            message = {**message, "headers": headers}
        await send(message)

    return dressed


def _hostname(host: str) -> str:
    """Without the port, in lower case."""
    if host.startswith("["):
        return host[1:].partition("]")[0].lower()
    return host.partition(":")[0].lower()


def _cookie(header: str, name: str) -> str:
    try:
        morsel: Any = SimpleCookie(header).get(name)
    except CookieError:
        return ""
    return morsel.value if morsel else ""


def _query_token(scope: Scope) -> str:
    """Only the page's own address may carry a token, and only until it is a cookie."""
    if scope["type"] != "http" or scope["path"] != "/" or scope["method"] != "GET":
        return ""
    query = parse_qs(scope["query_string"].decode("latin-1"))
    return query.get("token", [""])[0]


def _basic_password(secret: str) -> str | None:
    try:
        _, colon, password = base64.b64decode(secret, validate=True).decode().partition(":")
    except (binascii.Error, UnicodeDecodeError, ValueError):
        return None
    return password if colon else None
