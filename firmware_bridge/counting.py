"""Counters of 32 bits that wrap, made endless."""

from __future__ import annotations

_HALF = 1 << 31
_FULL = 1 << 32


def signed_difference(now: int, before: int) -> int:
    """The shortest way from `before` to `now` on a 32-bit ring, in [-2^31, 2^31)."""
    return (now - before + _HALF) % _FULL - _HALF


class EndlessCounter:
    """Follows a wrapping counter; `total` is what it has counted since the first value seen."""

    def __init__(self) -> None:
        self.total = 0
        self._last: int | None = None

    def follow(self, raw: int) -> int:
        """Take the counter's present value; returns the new total."""
        if self._last is not None:
            self.total += signed_difference(raw, self._last)
        self._last = raw
        return self.total

    def restarted(self) -> None:
        """The counter has begun again at zero; the total goes on from where it stood."""
        if self._last is not None:
            self._last = 0
