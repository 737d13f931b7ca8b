"""Ending in order when somebody asks for it with a signal."""

from __future__ import annotations

import signal
from types import FrameType, TracebackType
from typing import Any

SIGNALS = (signal.SIGTERM, signal.SIGINT)


class Ending:
    """While it is entered the first SIGTERM or Ctrl-C is a wish; the next one acts as ever.

    Only the main thread may enter it.
    """

    def __init__(self) -> None:
        self._name = ""
        self._before: dict[signal.Signals, Any] = {}

    def asked(self) -> str:
        """Name of the signal that asked for the end; empty while nobody has."""
        return self._name

    def __enter__(self) -> Ending:
        self._before = {number: signal.signal(number, self._wish) for number in SIGNALS}
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._restore()

    def _wish(self, number: int, frame: FrameType | None) -> None:
        self._name = signal.Signals(number).name
        self._restore()

    def _restore(self) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)
