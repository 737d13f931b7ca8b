"""A buzzer behind a file of the kernel (a LED's `brightness`, say): 1 sounds, 0 is silent."""

from __future__ import annotations

import contextlib
from pathlib import Path

SOUND_NS, PAUSE_NS, TIMES = 150_000_000, 250_000_000, 3


class Buzzer:
    """Three short beeps, switched by the loop: nothing waits. Without a path it is silent."""

    def __init__(self, path: str) -> None:
        self._path = Path(path) if path else None
        self._switches: list[tuple[int, str]] = []  # when, what to write

    def beep(self, now_ns: int) -> None:
        """Begin to sound; a beep in progress begins anew."""
        period_ns = SOUND_NS + PAUSE_NS
        self._switches = [
            (now_ns + k * period_ns + off * SOUND_NS, "0" if off else "1")
            for k in range(TIMES)
            for off in (0, 1)
        ]

    def poll(self, now_ns: int) -> None:
        """Switch what is due. A buzzer that is gone is no reason to stop cleaning."""
        while self._switches and self._switches[0][0] <= now_ns:
            _, value = self._switches.pop(0)
            if self._path is not None:
                with contextlib.suppress(OSError):
                    self._path.write_text(value, encoding="ascii")
