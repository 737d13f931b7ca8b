"""One connection of somebody who watches: what it knows already, and what waits to be sent.

The outbox has a bounded size and is emptied without waiting; who lets it fill up is hung up on, and
may come back and begin with the present state.
"""

from __future__ import annotations

import socket
from collections import deque

from robot.body.talk.stream import EYES

MAX_OUTBOX_BYTES = 1 << 20
MAX_LINE_BYTES = 256


class Watcher:
    """Used by the publisher's thread only."""

    def __init__(self, connection: socket.socket) -> None:
        connection.setblocking(False)
        self.connection = connection
        self.outbox: deque[memoryview] = deque()
        self.waiting_bytes = 0
        self.line = b""
        self.track = (-1, 0)
        self.greeted = False
        self.look_until_s = {eye: 0.0 for eye in EYES}
        self.gone = False

    def put(self, message: bytes) -> None:
        """Queue one frame, or give the watcher up."""
        self.waiting_bytes += len(message)
        self.outbox.append(memoryview(message))
        if self.waiting_bytes > MAX_OUTBOX_BYTES:
            self.gone = True

    def send(self) -> None:
        """Hand the system what it takes now."""
        try:
            while self.outbox:
                sent = self.connection.send(self.outbox[0])
                self.waiting_bytes -= sent
                if sent < len(self.outbox[0]):
                    self.outbox[0] = self.outbox[0][sent:]
                    return
                self.outbox.popleft()
        except BlockingIOError:
            pass
        except OSError:
            self.gone = True

    def lines(self) -> list[bytes]:
        """What the watcher has written since the last call."""
        try:
            data = self.connection.recv(MAX_LINE_BYTES)
        except BlockingIOError:
            return []
        except OSError:
            data = b""
        if not data or len(self.line) > MAX_LINE_BYTES:
            self.gone = True
            return []
        *lines, self.line = (self.line + data).split(b"\n")
        return lines
