"""The control socket: how a person's requests reach a running robot.

One request per connection, as one line of JSON: {"verb": "start", "args": []}; the answer is one
line too: {"accepted": true, "reason": "..."}, with "data" where the verb has more to tell. What can
be asked stands in `robot.mission.verbs`. The mission answers what it is asked; the runtime's books
answer for themselves. `watch` keeps its connection: it is handed to whoever publishes what the
robot sees and does. The file's permissions are the access control.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import socket
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from robot.errors import HardwareError, RequestError, SweeperError
from robot.messages import Answer, Request
from robot.mission.verbs import understand

WATCH = "watch"
MAX_LINE_BYTES = 4096
MAX_CLIENTS = 8
SILENCE_NS = 5_000_000_000  # a client that has not finished its line by then is hung up on

ANSWER_NS = 12_000_000_000  # who has had no answer by then gets none
Adopt = Callable[[socket.socket], bool]
Books = Mapping[str, Callable[[tuple[str, ...]], dict[str, Any]]]


class ControlSocket:
    """Server side, polled by the loop: never blocks it, never raises on what a client sends.

    `adopt` takes over the connection of a watcher; False: there are too many. With `judged`
    everybody waits until `answer` is told what became of the request; else every request is
    confirmed as it arrives. `books` answer their verbs at once, with what to send.
    """

    def __init__(self, path: Path, adopt: Adopt | None = None, *, judged: bool = False) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        with contextlib.suppress(FileNotFoundError):
            path.unlink()
        self._path = path
        self.adopt = adopt
        self.books: Books = {}
        self._judged = judged
        self._numbers = 0
        self._waiting: dict[int, tuple[int, socket.socket]] = {}  # since when, by request
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
        for number in [n for n, (since, _) in self._waiting.items() if now_ns - since > ANSWER_NS]:
            _, client = self._waiting.pop(number)
            _send(client, {"accepted": False, "reason": "the robot did not answer in time"})
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

    def answer(self, answer: Answer) -> None:
        """Tell who has asked what became of it."""
        _, client = self._waiting.pop(answer.request_id, (0, None))
        if client is None:
            return
        told: dict[str, Any] = {"accepted": answer.accepted, "reason": answer.reason}
        if answer.data:
            told["data"] = json.loads(answer.data)
        _send(client, told)

    def close(self) -> None:
        """Hang up and remove the socket file."""
        for client in [*self._clients, *(client for _, client in self._waiting.values())]:
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
        if request is not None and request.verb in self.books:
            _send(client, self._look_up(request))
            return None
        if request is None or not self._judged:
            _send(client, {"accepted": request is not None, "reason": reason})
            return request
        self._numbers += 1
        self._waiting[self._numbers] = (now_ns, client)
        return replace(request, request_id=self._numbers)

    def _look_up(self, request: Request) -> dict[str, Any]:
        try:
            return {"accepted": True, **self.books[request.verb](request.args)}
        except SweeperError as error:
            return {"accepted": False, "reason": str(error)}


def _send(client: socket.socket, told: dict[str, Any]) -> None:
    """One line, and the end of the connection; who is gone hears nothing."""
    with client, contextlib.suppress(OSError):
        client.sendall(json.dumps(told).encode() + b"\n")


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
    if not isinstance(verb, str):
        return None, "verb must be a text"
    if not isinstance(args, list) or not all(isinstance(a, str) for a in args):
        return None, "args must be a list of strings"
    try:
        known, rest = understand([verb, *args])
    except RequestError as error:
        return None, str(error)
    return Request(now_ns, known.name, rest), f"{known.name} was handed to the mission"


def ask(path: Path, verb: str, args: list[str], timeout_s: float = 15.0) -> dict[str, object]:
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
