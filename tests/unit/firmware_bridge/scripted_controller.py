"""The far end of a line in memory: answers as told, and keeps what it heard."""

from __future__ import annotations

from firmware_bridge.codec import Packet, pack, unpack
from firmware_bridge.framing import FrameDecoder, encode_frame
from firmware_bridge.messages import (
    PROTOCOL_VERSION,
    Ack,
    Clear,
    Drive,
    Hello,
    HelloAck,
    Message,
    Result,
    Stop,
    StopReason,
    Wheels,
)
from firmware_bridge.transport import MemoryTransport

MS = 1_000_000


class ScriptedController:
    """Not the firmware: only as much as a test of the link needs, and rude when told to be."""

    def __init__(self, line: MemoryTransport) -> None:
        self.line = line
        line.open()
        self.decoder = FrameDecoder()
        self.boot = 1
        self.session = 0
        self.protocol = PROTOCOL_VERSION
        self.stop_reason, self.latch = StopReason.RESET, 1
        self.heard: list[Packet] = []
        self.mute: set[type] = set()  # orders it does not answer
        self.start_ns = 0  # of its clock

    def say(self, message: Message, *, seq: int = 0, session: int | None = None) -> None:
        """One packet to the host."""
        session = self.session if session is None else session
        self.line.write(encode_frame(pack(Packet(seq, session, message))))

    def reset(self, now_ns: int) -> None:
        """As after a power cut."""
        self.boot += 1
        self.session = 0
        self.start_ns = now_ns
        self.stop_reason, self.latch = StopReason.RESET, 1

    def wheels(self, now_ns: int, left: int, right: int) -> None:
        """Encoder counts."""
        self.say(Wheels(self._time_us(now_ns), left, right))

    def _time_us(self, now_ns: int) -> int:
        return (now_ns - self.start_ns) // 1000 % 2**32

    def run(self, now_ns: int) -> None:
        """Answer what has arrived."""
        for body in self.decoder.feed(self.line.read()):
            packet = unpack(body)
            assert packet is not None
            self.heard.append(packet)
            if type(packet.message) not in self.mute:
                self._answer(packet, now_ns)

    def _answer(self, packet: Packet, now_ns: int) -> None:
        time_us = self._time_us(now_ns)
        if isinstance(packet.message, Hello):
            fits = packet.message.protocol == self.protocol
            self.session = packet.session if fits else 0
            latch = (int(self.stop_reason), self.latch)
            answer = HelloAck(time_us, self.protocol, 1, self.boot, 0xABCD, *latch)
            self.say(answer, seq=packet.seq)
            return
        result = Result.OK
        if packet.session != self.session:
            result = Result.NO_SESSION
        elif isinstance(packet.message, Stop):
            self.stop_reason, self.latch = StopReason.HOST, self.latch + 1
        elif isinstance(packet.message, Clear):
            if packet.message.latch == self.latch:
                self.stop_reason = StopReason.NONE
            else:
                result = Result.WRONG_LATCH
        elif isinstance(packet.message, Drive) and self.stop_reason != StopReason.NONE:
            result = Result.LATCHED
        session = 0 if result == Result.NO_SESSION else None
        answer_ack = Ack(time_us, packet.seq, result, int(self.stop_reason), self.latch)
        self.say(answer_ack, session=session)

    def count(self, kind: type) -> int:
        """How many of one kind were heard."""
        return sum(isinstance(packet.message, kind) for packet in self.heard)
