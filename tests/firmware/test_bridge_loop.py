"""The whole bridge: `WheelBridge` over `Link`, a pseudo-terminal and the host firmware."""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from firmware_bridge.host import HostFirmware, HostInputs
from firmware_bridge.link import Link
from firmware_bridge.transport import SerialTransport
from robot.config import LinkConfig, RobotConfig
from robot.hardware.wheels import WheelBridge
from robot.messages import (
    Battery,
    ClearOrder,
    Contact,
    DriveCommand,
    Event,
    LinkState,
    StopOrder,
    WheelTravel,
)

TICK_NS = 20_000_000


class Cable:
    """A serial port whose bytes can be lost, garbled, or cut off; the far end never knows."""

    def __init__(self, inner: SerialTransport) -> None:
        self.inner = inner
        self.inner.open()
        self.cut = False
        self.noise = random.Random(5)
        self.error_share = 0.0
        self.problem = ""
        self.is_open = False
        self.bytes_sent = self.bytes_received = 0

    def open(self) -> bool:
        self.is_open = not self.cut
        return self.is_open

    def close(self) -> None:
        self.is_open = False

    def tear(self) -> None:
        """Pull the plug."""
        self.cut, self.is_open = True, False

    def _garble(self, data: bytes) -> bytes:
        return bytes(
            self.noise.randrange(256) if self.noise.random() < self.error_share else byte
            for byte in data
        )

    def read(self) -> bytes:
        data = self.inner.read()
        return self._garble(data) if self.is_open else b""

    def write(self, data: bytes) -> bool:
        return self.is_open and self.inner.write(self._garble(data))


class Robot:
    """Firmware, motors and bridge, a tick at a time; brain and world in five lines."""

    def __init__(self, binary: Path, *, boot: int = 1) -> None:
        self.binary = binary
        self.now_ns = 0
        self.speed = [0.0, 0.0]
        self.travel = [0.0, 0.0]
        self.pins = HostInputs()
        self._start_firmware(boot)
        self.cable = Cable(self.port)
        self.link = Link(self.cable, first_session=1)
        self.wheels = WheelBridge(self.link, RobotConfig(), LinkConfig())
        self.events: list[Event] = []

    def _start_firmware(self, boot: int) -> None:
        self.firmware = HostFirmware(self.binary, boot=boot)
        self.port = SerialTransport(self.firmware.port)
        self.port.open()
        self.zero = list(self.travel)

    def reset_firmware(self, boot: int) -> None:
        """Power cut of the controller: another process, counts from zero."""
        self.close()
        self._start_firmware(boot)
        self.cable.inner = self.port
        self.speed = [0.0, 0.0]

    def close(self) -> None:
        self.port.close()
        self.firmware.close()

    def tick(self, v: float | None = None, *, yaw_rate: float = 0.0) -> None:
        for _ in range(4):
            counts = [int((t - z) * 5000) for t, z in zip(self.travel, self.zero, strict=True)]
            pins = replace(self.pins, left_ticks=counts[0], right_ticks=counts[1])
            out = self.firmware.step(5000, pins, self.port.bytes_sent)
            for side, pwm in enumerate((out.left_pwm, out.right_pwm)):
                self.speed[side] += (pwm * 0.6 - self.speed[side]) * 0.1
                self.travel[side] += self.speed[side] * 0.005
        self.port.read_until(out.bytes_sent_by_mcu)
        self.now_ns += TICK_NS
        self.events += self.wheels.poll(self.now_ns)
        if v is not None:
            self.wheels.send(DriveCommand(self.now_ns, v, yaw_rate, 1.0, 1.0, 200, "test"))

    def run(self, ticks: int, v: float | None = None, *, yaw_rate: float = 0.0) -> None:
        for _ in range(ticks):
            self.tick(v, yaw_rate=yaw_rate)

    def arm(self) -> None:
        self.run(10)
        self.wheels.send(ClearOrder(self.now_ns, "test"))
        self.run(3)
        assert self.link_state == (True, "")

    def of(self, kind: type[Event]) -> list[Event]:
        return [event for event in self.events if isinstance(event, kind)]

    @property
    def link_state(self) -> tuple[bool, str]:
        last = self.of(LinkState)[-1]
        assert isinstance(last, LinkState)
        return last.connected, last.stop_reason

    @property
    def measured(self) -> tuple[float, float]:
        last = self.of(WheelTravel)[-1]
        assert isinstance(last, WheelTravel)
        return last.left_m, last.right_m


@pytest.fixture
def robot(firmware_binary: Path) -> Iterator[Robot]:
    made = Robot(firmware_binary)
    yield made
    made.close()


def test_first_minute(robot: Robot) -> None:
    robot.run(10)
    assert [(e.connected, e.stop_reason) for e in robot.of(LinkState)[:2]] == [
        (False, "disconnected"),
        (True, "reset"),
    ]
    robot.run(10, 0.2)
    assert robot.travel == [0.0, 0.0]  # nobody has cleared the reset
    robot.arm()
    robot.run(100, 0.2)
    robot.run(30, 0.0)
    assert robot.measured == pytest.approx(robot.travel, abs=0.0005)
    assert robot.travel[0] == pytest.approx(0.4, abs=0.03)
    assert {type(e) for e in robot.events} == {WheelTravel, Contact, Battery, LinkState}


def test_turning_follows_the_track_width(robot: Robot) -> None:
    robot.arm()
    robot.run(100, 0.0, yaw_rate=1.0)
    robot.run(30, 0.0)
    left, right = robot.measured
    assert (right - left) / RobotConfig().track_width_m == pytest.approx(2.0, abs=0.15)


def test_times_are_exact_in_lock_step(robot: Robot) -> None:
    robot.run(200)
    for event in robot.of(WheelTravel)[2:]:
        assert isinstance(event, WheelTravel)
        assert abs(event.t_ns - event.arrived_ns) <= 2
        assert event.arrived_ns % TICK_NS == 0


def test_stop_clear_and_bump(robot: Robot) -> None:
    robot.arm()
    robot.run(30, 0.2)
    robot.wheels.send(StopOrder(robot.now_ns, "test"))
    robot.run(20, 0.2)
    assert robot.link_state == (True, "host")
    at = list(robot.travel)
    robot.run(20, 0.2)
    assert robot.travel == pytest.approx(at, abs=1e-3)
    robot.arm()
    robot.run(30, 0.2)
    robot.pins = replace(robot.pins, bump_left=True)
    robot.run(20, 0.2)
    assert robot.link_state == (True, "bump")
    last = robot.of(Contact)[-1]
    assert isinstance(last, Contact) and last.bump_left
    robot.arm()
    at = list(robot.travel)
    robot.run(50, -0.1)
    assert robot.travel[0] < at[0] - 0.05
    assert robot.link_state == (True, "")


def test_no_travel_is_lost_or_counted_twice_when_the_cable_is_torn(robot: Robot) -> None:
    robot.arm()
    for _ in range(5):
        robot.run(50, 0.2)
        robot.cable.tear()
        robot.run(60, 0.2)  # it rolls until its order expires, and nobody hears of it
        assert robot.link_state == (False, "disconnected")
        robot.cable.cut = False
        robot.run(30)
        assert robot.link_state[0]
        assert robot.measured == pytest.approx(robot.travel, abs=0.0005)
        robot.arm()


def test_a_reset_of_the_controller_goes_on_counting_and_stays_stopped(robot: Robot) -> None:
    robot.arm()
    robot.run(50, 0.2)
    before = robot.measured
    robot.reset_firmware(boot=2)
    zero = list(robot.travel)
    robot.run(60, 0.2)
    assert robot.link_state == (True, "reset")
    assert robot.travel == zero
    robot.arm()
    robot.run(50, 0.2)
    robot.run(30, 0.0)
    rolled = [end - start for end, start in zip(robot.travel, zero, strict=True)]
    gained = [end - start for end, start in zip(robot.measured, before, strict=True)]
    assert gained == pytest.approx(rolled, abs=0.001)


@pytest.mark.parametrize("share", [0.0001, 0.001, 0.01])
def test_a_bad_line_below_one_percent_stops_nothing(robot: Robot, share: float) -> None:
    robot.arm()
    robot.cable.error_share = share
    robot.run(1500, 0.2)
    assert robot.link_state == (True, "")
    assert robot.speed[0] == pytest.approx(0.2, abs=0.02)


def test_a_hopeless_line_stops_cleanly_and_recovers(robot: Robot) -> None:
    robot.arm()
    robot.run(50, 0.2)
    robot.cable.error_share = 0.5
    robot.run(100, 0.2)
    assert max(map(abs, robot.speed)) < 0.001
    robot.cable.error_share = 0.0
    robot.run(50, 0.2)
    assert robot.link_state in ((True, "expired"), (True, "link_lost"))


def test_the_same_life_twice(firmware_binary: Path) -> None:
    lives = []
    for _ in range(2):
        robot = Robot(firmware_binary)
        robot.arm()
        robot.cable.error_share = 0.002
        robot.run(300, 0.2, yaw_rate=0.3)
        lives.append(robot.events)
        robot.close()
    assert lives[0] == lives[1]
