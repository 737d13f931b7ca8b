"""The control socket: how a person's requests reach a running robot.

One request per connection, as one line of JSON: {"verb": "start", "args": []}; the answer is one
line too: {"accepted": true, "reason": "..."}. The file's permissions are the access control.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import socket
from pathlib import Path

from robot.errors import HardwareError
from robot.messages import Request

VERBS = ("start", "pause", "resume", "stop", "dock")
MAX_LINE_BYTES = 4096
MAX_CLIENTS = 8


class ControlSocket:
    """Server side, polled by the loop: never blocks it, never raises on what a client sends."""

    def __init__(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        with contextlib.suppress(FileNotFoundError):
            path.unlink()
        self._path = path
        self._server = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK)
        self._server.bind(str(path))
        os.chmod(path, 0o660)
        self._server.listen(MAX_CLIENTS)
        self._clients: dict[socket.socket, bytes] = {}

    def poll(self, now_ns: int) -> list[Request]:
        """Requests that have arrived since the last call."""
        if not select.select([self._server, *self._clients], [], [], 0)[0]:
            return []
        with contextlib.suppress(BlockingIOError):
            client, _ = self._server.accept()
            if len(self._clients) < MAX_CLIENTS:
                client.setblocking(False)
                self._clients[client] = b""
            else:
                client.close()
        return [r for client in list(self._clients) if (r := self._read(client, now_ns))]

    def close(self) -> None:
        """Hang up and remove the socket file."""
        for client in self._clients:
            client.close()
        self._server.close()
        with contextlib.suppress(FileNotFoundError):
            self._path.unlink()

    def _read(self, client: socket.socket, now_ns: int) -> Request | None:
        try:
            data = client.recv(MAX_LINE_BYTES)
        except BlockingIOError:
            return None
        except OSError:
            data = b""
        line = self._clients[client] + data
        if data and b"\n" not in line and len(line) < MAX_LINE_BYTES:
            self._clients[client] = line
            return None
        del self._clients[client]
        request, reason = parse_request(line, now_ns)
        answer = {"accepted": request is not None, "reason": reason}
        with client, contextlib.suppress(OSError):
            client.sendall(json.dumps(answer).encode() + b"\n")
        return request


def parse_request(line: bytes, now_ns: int) -> tuple[Request | None, str]:
    """A request and a confirming sentence, or None and what is wrong with the line."""
    try:
        body = json.loads(line)
        verb, args = body["verb"], body.get("args", [])
    except (ValueError, KeyError, TypeError, AttributeError):
        return None, 'a request is one line such as {"verb": "start", "args": []}'
    if verb not in VERBS:
        return None, f"unknown verb; choose one of {', '.join(VERBS)}"
    if not isinstance(args, list) or not all(isinstance(a, str) for a in args):
        return None, "args must be a list of strings"
    return Request(now_ns, verb, tuple(args)), f"{verb} was handed to the mission"


def ask(path: Path, verb: str, args: list[str], timeout_s: float = 2.0) -> dict[str, object]:
    """Client side: send one request and return the answer.

    Raises HardwareError when no robot listens at `path`.
    """
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as client:
        client.settimeout(timeout_s)
        try:
            client.connect(str(path))
            client.sendall(json.dumps({"verb": verb, "args": args}).encode() + b"\n")
            answer = json.loads(client.makefile("rb").readline() or b"{}")
        except (OSError, ValueError) as error:
            raise HardwareError(
                f"{path}: no robot answers there ({error}); start it with "
                "`sweeper run --body live` or give --socket."
            ) from None
    return answer
