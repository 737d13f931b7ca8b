"""How much anyone may ask for: a bucket of requests a client, patience for slow ones, and a cap."""

from __future__ import annotations

import asyncio
import time
from collections import OrderedDict
from collections.abc import Callable
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

MAX_BODY_BYTES = 16 * 1024
MAX_CONNECTIONS = 256
MAX_CLIENTS = 1024  # addresses that are remembered
HEADER_S = 10.0  # from the connection to a whole request
BODY_S = 10.0


class Buckets:
    """Token buckets by client: `burst` at once, `rate` a second after that."""

    def __init__(
        self, rate: float, burst: float, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._rate, self._burst, self._clock = rate, burst, clock
        self._levels: OrderedDict[str, tuple[float, float]] = OrderedDict()

    def take(self, client: str, cost: float = 1.0) -> bool:
        """Whether the client may have this; the bucket fills again with time."""
        now = self._clock()
        level, at = self._levels.pop(client, (self._burst, now))
        level = min(self._burst, level + (now - at) * self._rate)
        allowed = level >= cost
        self._levels[client] = (level - cost if allowed else level, now)
        while len(self._levels) > MAX_CLIENTS:
            self._levels.popitem(last=False)
        return allowed

    def wait_s(self, client: str, cost: float = 1.0) -> float:
        """How long until the client may have this."""
        level, _ = self._levels.get(client, (self._burst, 0.0))
        return max(0.0, (cost - level) / self._rate)


class PatientProtocol(H11Protocol):
    """uvicorn's HTTP, but nobody may hold a connection without asking for something."""

    _impatience: asyncio.TimerHandle | None = None

    def connection_made(self, transport: Any) -> None:
        """Refuse what is over the cap; start the clock for the others."""
        super().connection_made(transport)
        if len(self.connections) > MAX_CONNECTIONS:
            transport.abort()
            return
        self._impatience = self.loop.call_later(HEADER_S, self._give_up)

    def data_received(self, data: bytes) -> None:
        """Stop the clock once a whole head has arrived."""
        super().data_received(data)
        if self.scope is not None:
            self._calm()

    def send_400_response(self, msg: str) -> None:
        """A body that breaks the rules is answered here, so nobody else must answer, too."""
        if self.cycle is not None and self.cycle.response_started:
            self.transport.abort()
            return
        super().send_400_response(msg)
        if self.cycle is not None:
            self.cycle.disconnected = True
            self.cycle.message_event.set()

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget the clock."""
        self._calm()
        super().connection_lost(exc)

    def _give_up(self) -> None:
        if not self.transport.is_closing():
            self.transport.abort()

    def _calm(self) -> None:
        if self._impatience is not None:
            self._impatience.cancel()
            self._impatience = None
