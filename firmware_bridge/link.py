"""The link to the controller: session, orders with answers, telemetry in host time.

It owns no thread and no clock: the caller says `poll(now_ns)` often (50 Hz) and it does what is
due. It never blocks and never raises on what the line does; everything is counted. States:
closed (no port) -> greeting (Hello every 100 ms) -> connected (Keep every 100 ms) -> greeting again
when the controller falls silent or has forgotten the session -> closed when the port vanishes.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from firmware_bridge.clock import ClockMap
from firmware_bridge.codec import Packet, pack, unpack
from firmware_bridge.counting import EndlessCounter, LinkCounters
from firmware_bridge.framing import FrameDecoder, encode_frame
from firmware_bridge.messages import (
    FULL_SPEED_MM_S,
    LINK_TIMEOUT_MS,
    PROTOCOL_VERSION,
    Ack,
    Clear,
    Contacts,
    Drive,
    Hello,
    HelloAck,
    Keep,
    Message,
    Power,
    Result,
    Status,
    Stop,
    StopReason,
    Tune,
    Wheels,
)
from firmware_bridge.transport import Transport
from firmware_bridge.waiting import Waiting

MS = 1_000_000
REOPEN_NS = 250 * MS
HELLO_NS = 100 * MS  # between two Hellos, or two Keeps
SILENT_NS = LINK_TIMEOUT_MS * MS
GIVE_UP_NS = 3000 * MS  # a port silent for this long is closed and looked for again

Tap = Callable[[Literal["out", "in"], Packet], None]


@dataclass(frozen=True, slots=True)
class Received:
    """A telemetry message; `t_ns` is when the controller measured it, on the host's clock.

    The ticks of `Wheels` are endless and relative to the first ones received.
    """

    t_ns: int
    arrived_ns: int
    message: Wheels | Contacts | Power | Status


class Link:
    """See the module. `first_session` is drawn at random unless given (never 0).

    `full_speed_mm_s` is told to the controller whenever a session opens, before anything else.
    """

    def __init__(
        self,
        transport: Transport,
        *,
        first_session: int | None = None,
        tap: Tap | None = None,
        full_speed_mm_s: int = FULL_SPEED_MM_S,
    ) -> None:
        self._transport = transport
        self._tap = tap
        self._decoder = FrameDecoder()
        self._clock = ClockMap()
        self._left, self._right = EndlessCounter(), EndlessCounter()
        random = int.from_bytes(os.urandom(2), "little")
        self._session = (random if first_session is None else first_session) % 65535 or 1
        self._seq = 0
        self._sent_ns: dict[int, int] = {}  # sequence number -> when it was first sent
        self._pending: Waiting | None = None
        self._tune = Tune(full_speed_mm_s)
        self._tuning: Waiting | None = None
        self._next_open_ns: int | None = None
        self._next_hello_ns = 0
        self._heard_ns = 0
        self._boot: int | None = None
        self._last_t_ns = 0
        self._counters = LinkCounters()
        self.connected = False
        self.stop_reason = StopReason.NONE
        self.latch = 0
        self.controller: HelloAck | None = None  # who answered last
        self.problem = ""  # why there is no session, for people

    @property
    def counters(self) -> LinkCounters:
        """Counters, the decoder's included."""
        self._counters.frames = self._decoder.frames
        self._counters.crc_errors = self._decoder.crc_errors
        self._counters.framing_errors = self._decoder.framing_errors
        return self._counters

    @property
    def stopping(self) -> bool:
        """Whether a stop waits for its answer."""
        return self._pending is not None and isinstance(self._pending.message, Stop)

    def close(self) -> None:
        """Let go of the line."""
        self._transport.close()

    # ------------------------------------------------------------------ orders

    def drive(self, now_ns: int, order: Drive) -> bool:
        """Send an order to move; False when it cannot go out now (it is not kept for later).

        While a stop waits for its answer nothing else is ordered, nor before the motors are known.
        """
        if not self.connected or self.stopping or self._tuning:
            self._counters.unsent += 1
            return False
        return self._send(now_ns, order)

    def stop(self, now_ns: int) -> None:
        """Latch a stop; said again until it is answered, across reconnects too."""
        if not self.stopping:
            self._order(now_ns, Stop())

    def clear(self, now_ns: int) -> None:
        """Clear the stop that is known to be latched; dropped when a stop waits, or unconnected."""
        if not self.connected or self._pending:
            self._counters.unsent += not self.connected
            return
        self._order(now_ns, Clear(self.latch))

    def _order(self, now_ns: int, message: Stop | Clear) -> None:
        self._pending = Waiting(self._next_seq(), message, now_ns)
        self._retry(self._pending, now_ns)

    def _retry(self, waiting: Waiting | None, now_ns: int) -> None:
        """Say the waiting order (again) when it is due."""
        if waiting is None or not self.connected or not waiting.is_due(now_ns):
            return
        if waiting.given_up:
            self._pending = None
            return
        self._counters.retries += waiting.said(now_ns) > 1
        self._send(now_ns, waiting.message, waiting.seq)

    def _next_seq(self) -> int:
        self._seq = (self._seq + 1) % 256
        self._sent_ns.pop(self._seq, None)
        return self._seq

    def _send(self, now_ns: int, message: Message, seq: int | None = None) -> bool:
        packet = Packet(self._next_seq() if seq is None else seq, self._session, message)
        if not self._transport.write(encode_frame(pack(packet))):
            self._counters.unsent += 1
            return False
        self._sent_ns.setdefault(packet.seq, now_ns)
        if self._tap:
            self._tap("out", packet)
        return True

    # ------------------------------------------------------------------ the beat

    def poll(self, now_ns: int) -> list[Received]:
        """Do what is due and return the telemetry that has arrived, in order."""
        if not self._transport.is_open and not self._reopen(now_ns):
            return []
        received = []
        for body in self._decoder.feed(self._transport.read()):
            packet = unpack(body)
            if packet is None:
                self._counters.unknown += 1
                continue
            if self._tap:
                self._tap("in", packet)
            telemetry = self._take(packet, now_ns)
            if telemetry is not None:
                received.append(telemetry)
        self._keep_up(now_ns)
        return received

    def _reopen(self, now_ns: int) -> bool:
        if self.connected:
            self._lose("the serial port has gone")
        if self._next_open_ns is not None and now_ns < self._next_open_ns:
            return False
        self._next_open_ns = now_ns + REOPEN_NS
        if not self._transport.open():
            self.problem = self._transport.problem
            return False
        self._counters.opened += 1
        self._decoder.reset()
        self._transport.write(b"\0")  # ends whatever the line was in the middle of
        self._heard_ns = self._next_hello_ns = now_ns
        self.problem = "the controller has not answered yet"
        return True

    def _keep_up(self, now_ns: int) -> None:
        silent_ns = now_ns - self._heard_ns
        if self.connected and silent_ns >= SILENT_NS:
            self._lose("the controller has fallen silent")
        if silent_ns >= GIVE_UP_NS:
            self._transport.close()
            return
        if now_ns >= self._next_hello_ns:
            self._next_hello_ns = now_ns + HELLO_NS
            self._send(now_ns, Keep() if self.connected else Hello(PROTOCOL_VERSION))
        self._retry(self._tuning, now_ns)
        self._retry(self._pending, now_ns)

    def _lose(self, problem: str) -> None:
        """The session is over; the next Hello proposes another one."""
        self.connected = False
        self.problem = problem
        self._session = self._session % 65535 + 1
        self._sent_ns.clear()
        self._next_hello_ns = 0
        self._tuning = None
        if self._pending and isinstance(self._pending.message, Clear):
            self._pending = None  # whoever wants it cleared must see the new reason first

    # ------------------------------------------------------------------ what arrives

    def _take(self, packet: Packet, now_ns: int) -> Received | None:
        message = packet.message
        if isinstance(message, Ack) and message.result == Result.NO_SESSION:
            if self.connected:
                self._lose("the controller has forgotten the session")
            return None
        if isinstance(message, HelloAck) and message.protocol != PROTOCOL_VERSION:
            self._heard_ns = now_ns
            self.problem = (
                f"the controller speaks protocol {message.protocol} and this program "
                f"{PROTOCOL_VERSION}; flash the firmware that belongs to it"
            )
            return None
        if packet.session != self._session or not (self.connected or isinstance(message, HelloAck)):
            self._counters.foreign += 1
            return None
        self._heard_ns = now_ns
        if isinstance(message, HelloAck):
            self._welcome(message, now_ns)
            self._answered(packet.seq, message.time_us, now_ns)
        elif isinstance(message, Ack):
            self._note_latch(message)
            self._answered(message.order, message.time_us, now_ns)
            self._settle(message)
        elif isinstance(message, Wheels | Contacts | Power | Status):
            return self._telemetry(message, now_ns)
        return None

    def _welcome(self, ack: HelloAck, now_ns: int) -> None:
        self._note_latch(ack)
        self.controller = ack
        if self.connected:
            if ack.boot != self._boot:
                self._lose("the controller has started anew")
            return
        self.connected = True
        self.problem = ""
        self._counters.sessions += 1
        self._clock.reset()
        if self._boot is not None and ack.boot != self._boot:
            self._left.restarted()
            self._right.restarted()
        self._boot = ack.boot
        self._tuning = Waiting(self._next_seq(), self._tune, now_ns)

    def _note_latch(self, message: HelloAck | Ack | Status) -> None:
        known = message.stop_reason in StopReason._value2member_map_
        self.stop_reason = StopReason(message.stop_reason) if known else StopReason.HOST
        self.latch = message.latch

    def _answered(self, seq: int, taken_us: int, now_ns: int) -> None:
        sent_ns = self._sent_ns.pop(seq, None)
        if sent_ns is None:
            return
        self._clock.observe(taken_us, sent_ns)
        self._counters.waited((now_ns - sent_ns) / MS)

    def _settle(self, ack: Ack) -> None:
        if ack.result != Result.OK:
            self._counters.refused += 1
        if self._pending and self._pending.seq == ack.order:
            self._pending = None
        if self._tuning and self._tuning.seq == ack.order:
            self._tuning = None

    def _telemetry(self, message: Wheels | Contacts | Power | Status, now_ns: int) -> Received:
        t_ns = self._clock.to_host_ns(message.time_us) if self._clock.ready else now_ns
        self._last_t_ns = t_ns = max(self._last_t_ns, min(t_ns, now_ns))
        if isinstance(message, Wheels):
            left, right = (
                self._left.follow(message.left_ticks),
                self._right.follow(message.right_ticks),
            )
            message = Wheels(message.time_us, left, right)
        elif isinstance(message, Status):
            self._note_latch(message)
        return Received(t_ns, now_ns, message)
