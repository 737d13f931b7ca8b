"""An order that is said again until it is answered."""

from __future__ import annotations

from dataclasses import dataclass

from firmware_bridge.messages import Clear, Stop, Tune

RETRY_NS = 60_000_000
CLEAR_TRIES = 5  # a Clear is for the stop that somebody saw, not for ever


@dataclass
class Waiting:
    """`next_ns` is when to say it (again)."""

    seq: int
    message: Stop | Clear | Tune
    next_ns: int
    tries: int = 0

    def is_due(self, now_ns: int) -> bool:
        """Whether it is time to say it."""
        return now_ns >= self.next_ns

    @property
    def given_up(self) -> bool:
        """Whether it has been said often enough."""
        return isinstance(self.message, Clear) and self.tries >= CLEAR_TRIES

    def said(self, now_ns: int) -> int:
        """Note that it is said now; how often it has been."""
        self.next_ns = now_ns + RETRY_NS
        self.tries += 1
        return self.tries
