"""A link that is driven by hand: by the tools, one sentence after the other, on any clock."""

from __future__ import annotations

import time
from collections.abc import Callable

from firmware_bridge.errors import BridgeError
from firmware_bridge.link import Link, Received
from firmware_bridge.messages import Drive, HelloAck, Power, StopReason, Wheels

TICK_NS = 20_000_000
CONNECT_S = 3.0
ANSWER_S = 1.0


def _sleep_ns(duration_ns: int) -> None:
    time.sleep(duration_ns * 1e-9)


class Live:
    """Polls a link 50 times a second while time passes; keeps what it has heard."""

    def __init__(
        self,
        link: Link,
        *,
        now_ns: Callable[[], int] = time.monotonic_ns,
        sleep_ns: Callable[[int], None] = _sleep_ns,
    ) -> None:
        self.link = link
        self.now_ns = now_ns
        self._sleep_ns = sleep_ns
        self.received: list[Received] = []

    def wait(
        self, seconds: float, order: Drive | None = None, until: Callable[[], bool] | None = None
    ) -> bool:
        """Let time pass under an order, if there is one; whether `until` came true before."""
        end_ns = self.now_ns() + round(seconds * 1e9)
        while True:
            self.received += self.link.poll(self.now_ns())
            if until is not None and until():
                return True
            if self.now_ns() >= end_ns:
                return False
            if order is not None:
                self.link.drive(self.now_ns(), order)
            self._sleep_ns(TICK_NS)

    def connect(self) -> HelloAck:
        """Who answers. Raises BridgeError when nobody does."""
        if not self.wait(CONNECT_S, until=lambda: self.link.connected):
            raise BridgeError(
                f"link.port: there is no session ({self.link.problem}); check the cable, the "
                "controller's power and that its firmware is Sweeper's."
            )
        assert self.link.controller is not None
        return self.link.controller

    def latched(self) -> bool:
        """Whether a stop is latched."""
        return self.link.stop_reason != StopReason.NONE

    def clear(self) -> bool:
        """Clear the latched stop; False when its cause persists or nobody answers."""
        if not self.latched():
            return True
        self.link.clear(self.now_ns())
        return self.wait(ANSWER_S, until=lambda: not self.latched())

    def stop(self) -> bool:
        """Latch a stop; whether the controller has said so."""
        self.link.stop(self.now_ns())
        return self.wait(ANSWER_S, until=lambda: self.link.stop_reason == StopReason.HOST)

    def ticks(self) -> tuple[int, int]:
        """The wheels' endless counts, as last heard. Raises BridgeError when they never were."""
        wheels = [r.message for r in self.received if isinstance(r.message, Wheels)]
        if not wheels:
            raise BridgeError("the controller tells no wheel counts; flash its firmware again.")
        return wheels[-1].left_ticks, wheels[-1].right_ticks

    def power(self) -> Power | None:
        """Battery and current, as last heard."""
        powers = [r.message for r in self.received if isinstance(r.message, Power)]
        return powers[-1] if powers else None
