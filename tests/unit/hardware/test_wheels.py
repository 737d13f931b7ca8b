"""Commands to orders and telemetry to events; the line itself is tested elsewhere."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from firmware_bridge.counting import LinkCounters
from firmware_bridge.host import build_number
from firmware_bridge.link import Link, Received
from firmware_bridge.messages import (
    Board,
    Contacts,
    Drive,
    HelloAck,
    Power,
    Status,
    StopReason,
    Wheels,
)
from firmware_bridge.transport import memory_pair
from robot.config import LinkConfig, RobotConfig
from robot.errors import HardwareError
from robot.hardware.wheels import WheelBridge, open_wheels, wheel_speeds, who
from robot.messages import (
    Battery,
    ClearOrder,
    Contact,
    DriveCommand,
    LinkState,
    MissionState,
    StopOrder,
    WheelTravel,
)

MS = 1_000_000


class FakeLink:
    """Keeps what it is told; `arrivals` are what the next poll returns."""

    def __init__(self) -> None:
        self.connected = True
        self.stop_reason = StopReason.NONE
        self.counters = LinkCounters()
        self.arrivals: list[Received] = []
        self.told: list[tuple[str, int]] = []
        self.orders: list[Drive] = []

    def poll(self, now_ns: int) -> list[Received]:
        arrivals, self.arrivals = self.arrivals, []
        return arrivals

    def drive(self, now_ns: int, order: Drive) -> bool:
        self.orders.append(order)
        return True

    def stop(self, now_ns: int) -> None:
        self.told.append(("stop", now_ns))

    def clear(self, now_ns: int) -> None:
        self.told.append(("clear", now_ns))


@pytest.fixture
def link() -> FakeLink:
    return FakeLink()


@pytest.fixture
def wheels(link: FakeLink) -> WheelBridge:
    return WheelBridge(link, RobotConfig(track_width_m=0.2), LinkConfig())  # type: ignore[arg-type]


def command(v: float, w: float, *, brush: float = 0.0, fan: float = 0.0, ms: int = 200):  # type: ignore[no-untyped-def]
    """A drive command at time 5."""
    return DriveCommand(5, v, w, brush, fan, ms, "test")


@pytest.mark.parametrize(
    ("v", "w", "left", "right"),
    [
        (0.2, 0.0, 0.2, 0.2),
        (0.0, 1.0, -0.1, 0.1),
        (0.2, -1.0, 0.3, 0.1),
        (-0.1, 0.5, -0.15, -0.05),
        (1.0, 0.0, 0.5, 0.5),
        (0.4, 4.0, 0.0, 0.5),
        (-0.45, 1.5, -0.5, -0.25),
    ],
)
def test_wheel_speeds(v: float, w: float, left: float, right: float) -> None:
    assert wheel_speeds(v, w, 0.2, 0.5) == pytest.approx((left, right))


def test_clamping_keeps_the_curve() -> None:
    left, right = wheel_speeds(2.0, 3.0, 0.2, 0.5)
    assert (right - left) / 0.2 / ((right + left) / 2) == pytest.approx(3.0 / 2.0)


def test_drive_command_becomes_an_order(link: FakeLink, wheels: WheelBridge) -> None:
    wheels.send(command(0.2, -1.0, brush=0.5, fan=2.0, ms=250))
    assert link.orders == [Drive(300, 100, 50, 100, 250)]


@pytest.mark.parametrize(("given", "sent"), [(-5, 1), (0, 1), (1, 1), (1000, 1000), (9999, 1000)])
def test_validity_is_clamped(link: FakeLink, wheels: WheelBridge, given: int, sent: int) -> None:
    wheels.send(command(0.0, 0.0, ms=given))
    assert link.orders[0].valid_for_ms == sent


@pytest.mark.parametrize("v", [math.nan, math.inf, -math.inf])
def test_what_is_no_number_stands_still(link: FakeLink, wheels: WheelBridge, v: float) -> None:
    wheels.send(command(v, 0.0))
    wheels.send(command(0.0, v, brush=v, fan=v))
    assert all(order.left_mm_s == order.right_mm_s == 0 for order in link.orders)
    assert link.orders[1].brush_pct in (0, 100)


def test_stop_clear_and_what_is_not_for_wheels(link: FakeLink, wheels: WheelBridge) -> None:
    wheels.send(StopOrder(7, "test"))
    wheels.send(ClearOrder(8, "test"))
    wheels.send(MissionState(9, "idle", "", 0.0, 0.0))
    assert link.told == [("stop", 7), ("clear", 8)]
    assert link.orders == []


def test_telemetry_becomes_events(link: FakeLink, wheels: WheelBridge) -> None:
    link.arrivals = [
        Received(10, 20, Wheels(1, 5000, -2500)),
        Received(11, 20, Contacts(1, 0b1100_0010)),
        Received(12, 20, Contacts(1, 0b0000_0101)),
        Received(13, 20, Contacts(1, 0b0010_0000)),
        Received(14, 20, Power(1, 14200, 300, 1)),
        Received(15, 20, Status(1, 2, 0, 1, 0, 0, 0, 0, 0, 0)),
    ]
    events = wheels.poll(20)
    assert events == [
        WheelTravel(10, 20, 1.0, -0.5),
        Contact(11, bump_right=True, wheel_drop=True, charging=True),
        Contact(12, bump_left=True, cliff=True, cliff_sensors=0b0001),
        Contact(13, cliff=True, cliff_sensors=0b1000),
        Battery(14, 14.2, pytest.approx(50.0)),
        LinkState(20, True, ""),
    ]


@pytest.mark.parametrize(("mv", "pct"), [(0, 0.0), (12000, 0.0), (16400, 100.0), (20000, 100.0)])
def test_charge_stays_in_range(link: FakeLink, wheels: WheelBridge, mv: int, pct: float) -> None:
    link.arrivals = [Received(1, 1, Power(1, mv, 0, 0))]
    assert wheels.poll(1)[0] == Battery(1, mv / 1000.0, pct)


def test_link_state_on_change_and_five_times_a_second(link: FakeLink, wheels: WheelBridge) -> None:
    states = []
    for k in range(50):
        if k == 25:
            link.stop_reason = StopReason.WHEEL_DROP
        if k == 33:
            link.connected = False
        states += [(k, event) for event in wheels.poll(k * 20 * MS)]
    assert [k for k, _ in states] == [0, 10, 20, 25, 33, 43]
    reasons = [(e.connected, e.stop_reason) for _, e in states if isinstance(e, LinkState)]
    assert reasons[2:5] == [(True, ""), (True, "wheel_drop"), (False, "disconnected")]


def test_errors_and_retries_are_reported(link: FakeLink, wheels: WheelBridge) -> None:
    link.counters = LinkCounters(crc_errors=2, framing_errors=3, retries=4)
    assert wheels.poll(0) == [LinkState(0, True, "", 5, 4)]


def test_a_missing_port_says_how_to_find_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    with pytest.raises(HardwareError, match="/dev/no-such-port does not exist; list the ports"):
        open_wheels(RobotConfig(), LinkConfig(port="/dev/no-such-port"))
    monkeypatch.setattr("firmware_bridge.transport.BY_ID", tmp_path / "nothing")
    monkeypatch.setattr("firmware_bridge.transport.UDEV_NAME", tmp_path / "nothing")
    with pytest.raises(HardwareError, match="no motor controller was found on USB"):
        open_wheels(RobotConfig(), LinkConfig())


def test_who_answers_is_told_with_its_build() -> None:
    link = Link(memory_pair()[0])
    assert who(link) == "nobody"
    link.controller = HelloAck(0, 1, Board.HOST, 1, build_number(), 0, 0)
    assert who(link) == f"board host, build {build_number():08x}"
    link.controller = HelloAck(0, 1, Board.ATMEGA328P, 1, 0xAB, 0, 0)
    assert "board atmega328p, build 000000ab, another" in who(link)
    link.controller = HelloAck(0, 1, 77, 1, 0xAB, 0, 0)
    assert "board unknown" in who(link)
