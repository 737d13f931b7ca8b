"""Counting: 32-bit counters that wrap, made endless, and what has happened on the line."""

from __future__ import annotations

from dataclasses import dataclass, field

LATENCY_EDGES_MS = (1, 2, 5, 10, 15, 20, 30, 50, 100)

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


@dataclass
class LinkCounters:
    """What has happened on the line since the start."""

    frames: int = 0
    crc_errors: int = 0
    framing_errors: int = 0
    unknown: int = 0  # valid frames that say nothing in this protocol
    foreign: int = 0  # frames of another session
    unsent: int = 0  # orders that could not go out
    refused: int = 0  # orders the controller did not carry out
    retries: int = 0
    sessions: int = 0
    opened: int = 0
    latency: list[int] = field(default_factory=lambda: [0] * (len(LATENCY_EDGES_MS) + 1))

    def as_dict(self) -> dict[str, int | dict[str, int]]:
        """All of them by name; the latency histogram by its upper edges in ms."""
        edges = [f"<= {edge} ms" for edge in LATENCY_EDGES_MS] + [f"> {LATENCY_EDGES_MS[-1]} ms"]
        counts = {name: value for name, value in vars(self).items() if name != "latency"}
        return {**counts, "latency": dict(zip(edges, self.latency, strict=True))}

    def waited(self, waited_ms: float) -> None:
        """Note how long an order waited for its answer."""
        self.latency[sum(waited_ms > edge for edge in LATENCY_EDGES_MS)] += 1
