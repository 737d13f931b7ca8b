"""A bench around the host firmware: raw frames in, packets out, ideal motors, simulated time."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from firmware_bridge.board import EmulatedFirmware
from firmware_bridge.codec import Packet, pack, unpack
from firmware_bridge.framing import FrameDecoder, encode_frame
from firmware_bridge.host import HostFirmware, HostInputs, HostOutputs
from firmware_bridge.messages import (
    PROTOCOL_VERSION,
    TICKS_PER_METRE,
    Ack,
    Clear,
    Drive,
    Hello,
    HelloAck,
    Message,
    Result,
    Status,
    StopReason,
)
from firmware_bridge.transport import SerialTransport

M = TypeVar("M")
FULL_SPEED_MPS = 0.6
SESSION = 7


class Rig:
    """Owns a firmware process; `inputs` are its pins, kept up by `step`."""

    def __init__(
        self,
        binary: Path,
        *,
        boot: int = 1,
        piece_us: int = 5000,
        firmware: HostFirmware | None = None,
    ) -> None:
        self.firmware = firmware or HostFirmware(binary, boot=boot, piece_us=piece_us)
        self.transport = SerialTransport(self.firmware.port)
        assert self.transport.open(), self.transport.problem
        self.decoder = FrameDecoder()
        self.inputs = HostInputs()
        self.outputs = HostOutputs(0.0, 0.0, 0.0, 0.0, 0)
        self.gains = [1.0, 1.0]  # share of FULL_SPEED_MPS at full PWM
        self.lag_s = 0.05
        self.friction_mps2 = 0.0  # what a gearbox takes, however slow it turns
        self.speed_mps = [0.0, 0.0]
        self.travel_m = [0.0, 0.0]
        self.blocked = False
        self.encoder_signs = [1, 1]
        self.time_us = 0
        self.seq = 0
        self.packets: list[Packet] = []
        self.forward: Callable[[bytes], object] = bytes  # gets what the controller has said
        self.answer_ms = 1  # how long an order and its answer take

    def __enter__(self) -> Rig:
        return self

    def __exit__(self, *_: object) -> None:
        self.transport.close()
        self.firmware.close()

    # ------------------------------------------------------------------ line

    def write(self, data: bytes) -> None:
        """Raw bytes onto the line."""
        assert self.transport.write(data)

    def send(self, message: Message, *, session: int = SESSION) -> int:
        """One packet onto the line; returns its sequence number."""
        self.seq = (self.seq + 1) % 256
        self.write(encode_frame(pack(Packet(self.seq, session, message))))
        return self.seq

    def ask(self, message: Message, *, session: int = SESSION) -> Result:
        """Send an order, let its answer come, and return what became of it."""
        seq, before = self.send(message, session=session), len(self.heard(Ack))
        for _ in range(self.answer_ms):
            self.step()
            answers = [a for a in self.heard(Ack)[before:] if a.order == seq]
            if answers:
                assert len(answers) == 1
                return Result(answers[0].result)
        raise AssertionError(f"no answer to {message}")

    def heard(self, kind: type[M]) -> list[M]:
        """All messages of one kind so far."""
        return [p.message for p in self.packets if isinstance(p.message, kind)]

    @property
    def latch(self) -> tuple[StopReason, int]:
        """The last word on the latch, and its number."""
        for packet in reversed(self.packets):
            if isinstance(packet.message, Ack | HelloAck | Status):
                return StopReason(packet.message.stop_reason), packet.message.latch
        raise AssertionError("nothing was heard about the latch")

    # ------------------------------------------------------------------ time

    def step(self, ms: int = 1, **pins: float | bool) -> HostOutputs:
        """Let time pass, a millisecond at a time, with changed pins."""
        return self.advance(ms, 1000, **pins)

    def advance(self, steps: int, step_us: int, **pins: float | bool) -> HostOutputs:
        """The same in steps of another length."""
        self.inputs = replace(self.inputs, **pins)  # type: ignore[arg-type]
        for _ in range(steps):
            self.outputs = self.firmware.step(step_us, self.inputs, self.transport.bytes_sent)
            self._move(step_us * 1e-6)
            self.time_us += step_us
        self.transport.read_until(self.outputs.bytes_sent_by_mcu)
        data = self.transport.read()
        self.forward(data)
        for body in self.decoder.feed(data):
            packet = unpack(body)
            assert packet is not None
            self.packets.append(packet)
        return self.outputs

    def _move(self, dt_s: float) -> None:
        for side, pwm in enumerate((self.outputs.left_pwm, self.outputs.right_pwm)):
            wanted = 0.0 if self.blocked else pwm * self.gains[side] * FULL_SPEED_MPS
            speed = self.speed_mps[side]
            speed += (wanted - speed) * dt_s / self.lag_s
            drag = self.friction_mps2 * dt_s
            speed = 0.0 if abs(speed) <= drag else speed - math.copysign(drag, speed)
            self.speed_mps[side] = speed
            self.travel_m[side] += speed * dt_s
        left, right = (
            _ticks(sign * travel)
            for sign, travel in zip(self.encoder_signs, self.travel_m, strict=True)
        )
        self.inputs = replace(self.inputs, left_ticks=left, right_ticks=right)

    # ------------------------------------------------------------------ phrases

    def arm(self) -> None:
        """Open the session and clear what is latched."""
        self.send(Hello(PROTOCOL_VERSION))
        self.step(self.answer_ms)
        self.clear()

    def clear(self) -> None:
        """Clear the latched stop; it must work."""
        assert self.ask(Clear(self.latch[1])) == Result.OK

    def drive(self, left_mm_s: int, right_mm_s: int, ms: int, *, valid_for_ms: int = 100) -> None:
        """Order these speeds every 20 ms for `ms`, as a host does."""
        for _ in range(0, ms, 20):
            self.send(Drive(left_mm_s, right_mm_s, 50, 40, valid_for_ms))
            self.step(20)

    @property
    def still(self) -> bool:
        """Whether every output is off."""
        o = self.outputs
        return o.left_pwm == o.right_pwm == o.brush_pwm == o.fan_pwm == 0.0


def _ticks(travel_m: float) -> int:
    """What a 32-bit encoder counter shows."""
    return (int(travel_m * TICKS_PER_METRE) + 2**31) % 2**32 - 2**31


def emulated_rig(board: tuple[Path, Path], **options: str | Path) -> Rig:
    """A rig around the ATmega328P image (emulator, image), with motors as a gearbox makes them.

    Friction takes a tenth of the full PWM. An order and its answer need 4 ms on the line, and more
    where telemetry is before them.
    """
    rig = Rig(board[0], firmware=EmulatedFirmware(*board, **options))  # type: ignore[arg-type]
    rig.answer_ms = 20
    rig.friction_mps2 = 0.1 * FULL_SPEED_MPS / rig.lag_s
    rig.step(20)  # it starts
    return rig
