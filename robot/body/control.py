"""The control socket: how a person's requests reach a running robot.

One request per connection, as one line of JSON: {"verb": "start", "args": []}; the answer is one
line too: {"accepted": true, "reason": "..."}. `watch` keeps its connection: it is handed to whoever
publishes what the robot sees and does. The file's permissions are the access control.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import socket
from collections.abc import Callable
from pathlib import Path

from robot.errors import HardwareError
from robot.messages import Request

VERBS = ("start", "pause", "resume", "stop", "dock")
WATCH = "watch"
MAX_LINE_BYTES = 4096
MAX_CLIENTS = 8
SILENCE_NS = 5_000_000_000  # a client that has not finished its line by then is hung up on

Adopt = Callable[[socket.socket], bool]


class ControlSocket:
    """Server side, polled by the loop: never blocks it, never raises on what a client sends.

    `adopt` takes over the connection of a watcher; False: there are too many.
    """

    def __init__(self, path: Path, adopt: Adopt | None = None) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        with contextlib.suppress(FileNotFoundError):
            path.unlink()
        self._path = path
        self.adopt = adopt
        self._server = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK)
        try:
            self._server.bind(str(path))
        except OSError as error:
            self._server.close()
            raise HardwareError(
                f"--socket {path}: cannot be opened ({error}); give a short path in a writable "
                "folder."
            ) from None
        os.chmod(path, 0o660)
        self._server.listen(MAX_CLIENTS)
        self._clients: dict[socket.socket, tuple[int, bytes]] = {}  # since when, line so far

    def poll(self, now_ns: int) -> list[Request]:
        """Requests that have arrived since the last call."""
        for client in [c for c, (since, _) in self._clients.items() if now_ns - since > SILENCE_NS]:
            del self._clients[client]
            client.close()
        if not select.select([self._server, *self._clients], [], [], 0)[0]:
            return []
        with contextlib.suppress(BlockingIOError):
            client, _ = self._server.accept()
            if len(self._clients) < MAX_CLIENTS:
                client.setblocking(False)
                self._clients[client] = (now_ns, b"")
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
        since_ns, line = self._clients[client]
        line += data
        if data and b"\n" not in line and len(line) < MAX_LINE_BYTES:
            self._clients[client] = (since_ns, line)
            return None
        del self._clients[client]
        if wants_to_watch(line) and self.adopt is not None and self.adopt(client):
            return None
        request, reason = parse_request(line, now_ns)
        answer = {"accepted": request is not None, "reason": reason}
        with client, contextlib.suppress(OSError):
            client.sendall(json.dumps(answer).encode() + b"\n")
        return request


def wants_to_watch(line: bytes) -> bool:
    """Whether the line asks for the stream."""
    try:
        return bool(json.loads(line)["verb"] == WATCH)
    except (ValueError, KeyError, TypeError, IndexError, RecursionError):
        return False


def parse_request(line: bytes, now_ns: int) -> tuple[Request | None, str]:
    """A request and a confirming sentence, or None and what is wrong with the line."""
    try:
        body = json.loads(line)
        verb, args = body["verb"], body.get("args", [])
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None, 'a request is one line such as {"verb": "start", "args": []}'
    if verb == WATCH:
        return None, "nobody can watch this robot, or too many do"
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
