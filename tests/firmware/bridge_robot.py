"""A robot of firmware, motors and the whole bridge, tick by tick, on a line that can be hurt."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

from firmware_bridge.board import EmulatedFirmware
from firmware_bridge.host import HostFirmware, HostInputs
from firmware_bridge.link import Link
from firmware_bridge.transport import SerialTransport, memory_pair
from robot.config import LinkConfig, RobotConfig
from robot.hardware.wheels import WheelBridge
from robot.messages import (
    ClearOrder,
    DriveCommand,
    Event,
    LinkState,
    WheelTravel,
)

TICK_NS = 20_000_000
TICKS_PER_METRE = 5000
FULL_SPEED_MPS = 0.6


@dataclass
class Noise:
    """What a bad line does to bytes: the share of each that is hurt in one of four ways."""

    chance: random.Random = field(default_factory=lambda: random.Random(5))
    flipped: float = 0.0
    dropped: float = 0.0
    doubled: float = 0.0
    inserted: float = 0.0
    hurt: int = 0

    def over(self, data: bytes) -> bytes:
        """What arrives of `data`."""
        if self.flipped + self.dropped + self.doubled + self.inserted == 0.0:
            return data
        return b"".join(self._byte(byte) for byte in data)

    def _byte(self, byte: int) -> bytes:
        draw = self.chance.random()
        whole = bytes([byte])
        self.hurt += 1
        for share, result in (
            (self.flipped, lambda: bytes([byte ^ (1 << self.chance.randrange(8))])),
            (self.dropped, lambda: b""),
            (self.doubled, lambda: whole + whole),
            (self.inserted, lambda: whole + bytes([self.chance.randrange(256)])),
        ):
            if draw < share:
                return result()
            draw -= share
        self.hurt -= 1
        return whole


class Cable:
    """A serial port whose bytes can be lost, garbled, or cut off; the far end never knows."""

    def __init__(self, inner: SerialTransport) -> None:
        self.inner = inner
        self.inner.open()
        self.cut = False
        self.noise = Noise()
        self.dead = False  # the line is there, but nothing gets through
        self.problem = ""
        self.is_open = False
        self.bytes_sent = self.bytes_received = 0

    def open(self) -> bool:
        """Open it, unless it is torn; what was sent meanwhile has gone."""
        if not self.is_open and not self.cut:
            self.inner.read()
        self.is_open = not self.cut
        return self.is_open

    def close(self) -> None:
        """Let go of it."""
        self.is_open = False

    def tear(self) -> None:
        """Pull the plug."""
        self.cut, self.is_open = True, False

    def read(self) -> bytes:
        """What has come through."""
        data = self.inner.read()
        self.bytes_received += len(data)
        return self.noise.over(data) if self.is_open and not self.dead else b""

    def write(self, data: bytes) -> bool:
        """Send what comes through."""
        self.bytes_sent += len(data)
        if not self.is_open:
            return False
        return True if self.dead else self.inner.write(self.noise.over(data))


class MemoryCable(Cable):
    """The same, with a line in memory between the link and the port."""

    def __init__(self, inner: SerialTransport) -> None:
        super().__init__(inner)
        self.near, self.far = memory_pair()
        self.near.open()
        self.far.open()

    def read(self) -> bytes:
        self.far.write(super().read())
        return self.near.read()

    def write(self, data: bytes) -> bool:
        self.near.write(data)
        return super().write(self.far.read())


class HostBoard:
    """The firmware built for this computer; a reset is another process that counts from zero."""

    def __init__(self, binary: Path) -> None:
        self.binary, self.boot = binary, 0
        self.zero = [0.0, 0.0]

    def start(self, travel: list[float]) -> HostFirmware:
        """Power on."""
        self.boot += 1
        self.zero = list(travel)
        return HostFirmware(self.binary, boot=self.boot)

    def reset(self, firmware: HostFirmware, travel: list[float]) -> HostFirmware:
        """Power off and on."""
        firmware.close()
        return self.start(travel)


class EmulatedBoard:
    """The real image on the emulated board; encoders stay where they are over a reset."""

    zero = (0.0, 0.0)

    def __init__(self, board: tuple[Path, Path]) -> None:
        self.board = board

    def start(self, travel: list[float]) -> HostFirmware:
        """Power on."""
        return EmulatedFirmware(*self.board)

    def reset(self, firmware: HostFirmware, travel: list[float]) -> HostFirmware:
        """Power off and on."""
        assert isinstance(firmware, EmulatedFirmware)
        firmware.power_cycle()
        return firmware


class Robot:
    """Firmware, motors and bridge, a tick at a time; brain and world in five lines."""

    def __init__(
        self,
        board: HostBoard | EmulatedBoard,
        *,
        cable: Callable[[SerialTransport], Cable] = Cable,
        max_step_us: int = 5000,
    ) -> None:
        self.board = board
        self.now_ns = 0
        self.step_us = max_step_us
        self.speed = [0.0, 0.0]
        self.travel = [0.0, 0.0]
        self.pwm = (0.0, 0.0)
        self.pins = HostInputs()
        self.firmware = board.start(self.travel)
        self.port = SerialTransport(self.firmware.port)
        self.cable = cable(self.port)
        self.link = Link(self.cable, first_session=1)
        self.wheels = WheelBridge(self.link, RobotConfig(), LinkConfig())
        self.events: list[Event] = []

    def reset(self) -> None:
        """Power cut of the controller."""
        before, self.firmware = self.firmware, self.board.reset(self.firmware, self.travel)
        self.speed = [0.0, 0.0]
        if self.firmware is not before:
            self.port.close()
            self.cable.inner = self.port = SerialTransport(self.firmware.port)
            self.port.open()

    def close(self) -> None:
        """End the firmware."""
        self.port.close()
        self.firmware.close()

    def tick(self, v: float | None = None, *, yaw_rate: float = 0.0) -> None:
        """20 ms, then the bridge's turn, then the order for the next 200 ms."""
        self.live(TICK_NS // 1000)
        self.events += self.wheels.poll(self.now_ns)
        if v is not None:
            self.wheels.send(DriveCommand(self.now_ns, v, yaw_rate, 1.0, 1.0, 200, "test"))

    def live(self, us: int) -> None:
        """Let the controller and the motors live, without the host."""
        for _ in range(us // self.step_us):
            counts = [
                int((t - z) * TICKS_PER_METRE)
                for t, z in zip(self.travel, self.board.zero, strict=True)
            ]
            pins = replace(self.pins, left_ticks=counts[0], right_ticks=counts[1])
            out = self.firmware.step(self.step_us, pins, self.port.bytes_sent)
            self.pwm = (out.left_pwm, out.right_pwm)
            share = self.step_us * 1e-6 / 0.05
            for side, pwm in enumerate(self.pwm):
                self.speed[side] += (pwm * FULL_SPEED_MPS - self.speed[side]) * share
                self.travel[side] += self.speed[side] * self.step_us * 1e-6
        self.port.read_until(out.bytes_sent_by_mcu)
        self.now_ns += us * 1000

    def run(self, ticks: int, v: float | None = None, *, yaw_rate: float = 0.0) -> None:
        """Some ticks alike."""
        for _ in range(ticks):
            self.tick(v, yaw_rate=yaw_rate)

    def arm(self) -> None:
        """Clear what is latched; it must work."""
        self.run(10)
        self.wheels.send(ClearOrder(self.now_ns, "test"))
        self.run(3)
        assert self.link_state == (True, ""), self.link_state

    def of(self, kind: type[Event]) -> list[Event]:
        """All events of one kind so far."""
        return [event for event in self.events if isinstance(event, kind)]

    @property
    def link_state(self) -> tuple[bool, str]:
        """Connected, and the latched reason."""
        last = self.of(LinkState)[-1]
        assert isinstance(last, LinkState)
        return last.connected, last.stop_reason

    @property
    def measured(self) -> tuple[float, float]:
        """What the bridge says that the wheels have rolled."""
        last = self.of(WheelTravel)[-1]
        assert isinstance(last, WheelTravel)
        return last.left_m, last.right_m
