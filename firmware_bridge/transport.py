"""Lines to the controller: a serial port, and a pair in memory for tests.

A transport never blocks and never raises: a port that is gone shows in `is_open` and `problem`.
"""

from __future__ import annotations

import contextlib
import os
import select
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from firmware_bridge.errors import BridgeError

if TYPE_CHECKING:
    import serial

UDEV_NAME = Path("/dev/sweeper-wheels")
BY_ID = Path("/dev/serial/by-id")
KNOWN = ("arduino", "1a86", "ch340", "ftdi", "ft232", "cp210", "2341")  # boards' USB names
FIND_HINT = "list the ports with `python -m serial.tools.list_ports -v` and set link.port"
_CHUNK = 4096
_DELIVERY_S = 5.0


class Transport(Protocol):
    """A line of bytes, both ways; counts what has passed since it was made."""

    bytes_sent: int
    bytes_received: int
    problem: str  # why it is not open, for people; empty when it is

    @property
    def is_open(self) -> bool: ...

    def open(self) -> bool:
        """Try to open; whether it is open now."""

    def read(self) -> bytes:
        """What has arrived; empty when nothing has."""

    def write(self, data: bytes) -> bool:
        """Send `data` whole, or drop it whole where the line is full; whether it was taken."""

    def close(self) -> None: ...


def find_port() -> str:
    """The controller's serial port, by udev name or USB name.

    Raises BridgeError when there is none, or more than one candidate.
    """
    if UDEV_NAME.exists():
        return str(UDEV_NAME)
    names = sorted(BY_ID.iterdir()) if BY_ID.is_dir() else []
    found = [name for name in names if any(word in name.name.lower() for word in KNOWN)]
    if len(found) == 1:
        return str(found[0])
    if found:
        listed = ", ".join(map(str, found))
        raise BridgeError(f"link.port: several serial ports could be the controller ({listed}); "
                          "set link.port to the right one.")  # fmt: skip
    raise BridgeError(
        f"link.port: no motor controller was found on USB; plug it in, or {FIND_HINT}."
    )


class SerialTransport:
    """A serial port or pseudo-terminal through pyserial; an empty `port` means: find it."""

    def __init__(
        self, port: str = "", baud: int = 115200, *, find: Callable[[], str] = find_port
    ) -> None:
        self._port, self._baud, self._find = port, baud, find
        self._serial: serial.Serial | None = None
        self._poll = select.poll()
        self._arrived = bytearray()  # by read_until, not yet handed out
        self._unsent = b""  # rest of a chunk that the line took in part
        self.bytes_sent = 0
        self.bytes_received = 0
        self.problem = "not opened yet"

    @property
    def is_open(self) -> bool:
        """Whether the port is there and open."""
        return self._serial is not None

    def open(self) -> bool:
        """Open the port, wherever it is now."""
        import serial

        if self._serial is not None:
            return True
        try:
            port = self._port or self._find()
            self._serial = serial.Serial(port, self._baud, timeout=0, exclusive=True)
        except (BridgeError, OSError, ValueError) as error:
            self.problem = self._explain(error)
            return False
        self._poll = select.poll()
        self._poll.register(self._serial.fileno(), select.POLLIN)
        self._unsent = b""
        self.problem = ""
        return True

    def _explain(self, error: Exception) -> str:
        if isinstance(error, BridgeError):
            return str(error)
        if not os.path.exists(self._port):
            return f"link.port: the serial port {self._port} does not exist; {FIND_HINT}."
        return f"link.port: the serial port {self._port} cannot be opened ({error}); {FIND_HINT}."

    def close(self, problem: str = "closed") -> None:
        """Let go of the port; `problem` says why."""
        if self._serial is not None:
            with contextlib.suppress(OSError):
                self._serial.close()
            self._serial = None
            self.problem = problem

    def read(self) -> bytes:
        """What has arrived so far."""
        self._receive(0.0)
        arrived = bytes(self._arrived)
        self._arrived.clear()
        return arrived

    def read_until(self, total: int) -> None:
        """Wait until `total` bytes have arrived since the start (lock-step with a simulator).

        They stay here until `read`. Raises BridgeError when they do not come.
        """
        deadline_s = time.monotonic() + _DELIVERY_S
        while self.bytes_received < total:
            self._receive(0.1)
            late = self.bytes_received < total and time.monotonic() > deadline_s
            if not self.is_open or late:
                raise BridgeError(
                    f"{self._port}: {total} bytes were promised and {self.bytes_received} came; "
                    "start the firmware again."
                )

    def _receive(self, timeout_s: float) -> None:
        if self._serial is None:
            return
        try:
            for _, events in self._poll.poll(timeout_s * 1e3):
                data = os.read(self._serial.fileno(), _CHUNK) if events & select.POLLIN else b""
                if not data:
                    self.close("the port has gone")
                self._arrived += data
                self.bytes_received += len(data)
        except BlockingIOError:
            return
        except OSError as error:
            self.close(f"the port has gone ({error})")

    def write(self, data: bytes) -> bool:
        """Send `data`, or drop it where the line is full: half a frame is never left behind."""
        if self._unsent:
            self._unsent = self._unsent[self._push(self._unsent) :]
        if self._unsent:
            return False
        taken = self._push(data)
        self._unsent = data[taken:] if taken else b""
        return taken > 0

    def _push(self, data: bytes) -> int:
        """Hand `data` to the line; how many bytes of it were taken."""
        if self._serial is None:
            return 0
        try:
            taken = os.write(self._serial.fileno(), data)
        except BlockingIOError:
            return 0
        except OSError as error:
            self.close(f"the port has gone ({error})")
            return 0
        self.bytes_sent += taken
        return taken


class MemoryTransport:
    """One end of a line in memory; made by `memory_pair`."""

    def __init__(self) -> None:
        self.peer: MemoryTransport = self
        self.plugged = True
        self._open = False
        self._inbox = bytearray()
        self.bytes_sent = 0
        self.bytes_received = 0
        self.problem = "not opened yet"

    @property
    def is_open(self) -> bool:
        """Whether this end is open."""
        return self._open and self.plugged

    def open(self) -> bool:
        """Open this end, if it is plugged in."""
        self._open = self.plugged
        self.problem = "" if self.plugged else "unplugged"
        return self._open

    def close(self) -> None:
        """Close this end; what arrives meanwhile is lost."""
        self._open = False
        self._inbox.clear()
        self.problem = "closed"

    def unplug(self) -> None:
        """Tear the cable: both ends lose what is under way."""
        self.plugged = self._open = False
        self._inbox.clear()

    def plug(self) -> None:
        """Put the cable back; the end must be opened again."""
        self.plugged = True

    def read(self) -> bytes:
        """What has arrived so far."""
        data = bytes(self._inbox)
        self._inbox.clear()
        self.bytes_received += len(data)
        return data

    def write(self, data: bytes) -> bool:
        """Hand `data` to the other end."""
        if not self.is_open:
            return False
        self.bytes_sent += len(data)
        if self.peer.is_open:
            self.peer._inbox += data
        return True


def memory_pair() -> tuple[MemoryTransport, MemoryTransport]:
    """Two ends of one line."""
    left, right = MemoryTransport(), MemoryTransport()
    left.peer, right.peer = right, left
    return left, right
