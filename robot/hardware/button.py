"""The start button: a key of the kernel's input layer (dtoverlay=gpio-key), read without waiting.

`struct input_event` of linux/input.h: two longs of time, then type, code and value.
"""

from __future__ import annotations

import os
import struct
from typing import Literal

_EVENT = struct.Struct("llHHi")
_EV_KEY = 1
LONG_NS = 1_500_000_000
_RETRY_NS = 2_000_000_000
Press = Literal["short", "long"]


class Button:
    """Tells presses when the key is let go; without a path or a device, nothing is pressed."""

    def __init__(self, path: str) -> None:
        self._path = path
        self._fd = -1
        self._next_open_ns = 0
        self._down_ns = -1
        self._rest = b""

    def poll(self, now_ns: int) -> Press | None:
        """The press that has just ended, if one has."""
        if self._fd < 0 and not self._open(now_ns):
            return None
        press: Press | None = None
        try:
            self._rest += os.read(self._fd, 64 * _EVENT.size)
        except BlockingIOError:
            return None
        except OSError:  # the device is gone; look for it again
            self.close()
            return None
        while len(self._rest) >= _EVENT.size:
            _, _, kind, _, value = _EVENT.unpack(self._rest[: _EVENT.size])
            self._rest = self._rest[_EVENT.size :]
            if kind != _EV_KEY:
                continue
            if value == 1:
                self._down_ns = now_ns
            elif value == 0 and self._down_ns >= 0:
                press = "long" if now_ns - self._down_ns >= LONG_NS else "short"
                self._down_ns = -1
        return press

    def close(self) -> None:
        """Give the device back."""
        if self._fd >= 0:
            os.close(self._fd)
        self._fd, self._rest, self._down_ns = -1, b"", -1

    def _open(self, now_ns: int) -> bool:
        if not self._path or now_ns < self._next_open_ns:
            return False
        self._next_open_ns = now_ns + _RETRY_NS
        try:
            self._fd = os.open(self._path, os.O_RDONLY | os.O_NONBLOCK)
        except OSError:
            return False
        return True


def verb_of(press: Press, state: str) -> str:
    """What a press asks for: short starts, pauses and resumes, long sends the robot home."""
    if press == "long":
        return "dock"
    if state == "paused":
        return "resume"
    return "start" if state in ("", "none", "idle", "docked", "done", "error") else "pause"
