"""What the link promises, whatever carries its bytes: a line in memory, a pseudo-terminal with the
host firmware behind it, and the emulated controller's UART."""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import replace

import pytest
from bridge_robot import EmulatedBoard, HostBoard, MemoryCable, Noise, Robot

from firmware_bridge.messages import Board
from robot.config import RobotConfig
from robot.messages import (
    Battery,
    ClearOrder,
    Contact,
    LinkState,
    StopOrder,
    WheelTravel,
)


@pytest.fixture(params=["memory", "pty", "emulated"])
def robot(request: pytest.FixtureRequest) -> Iterator[Robot]:
    """A robot on each kind of line."""
    if request.param == "emulated":
        made = Robot(EmulatedBoard(request.getfixturevalue("emulated_board")))
    else:
        board = HostBoard(request.getfixturevalue("firmware_binary"))
        options = {"cable": MemoryCable} if request.param == "memory" else {}
        made = Robot(board, **options)
    yield made
    made.close()


def test_first_minute(robot: Robot) -> None:
    robot.run(15)
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
    assert robot.link.counters.sessions == robot.link.counters.opened == 1
    assert robot.link.controller is not None
    assert robot.link.controller.board in (Board.HOST, Board.ATMEGA328P)


def test_turning_follows_the_track_width(robot: Robot) -> None:
    robot.arm()
    robot.run(100, 0.0, yaw_rate=1.0)
    robot.run(30, 0.0)
    left, right = robot.measured
    assert (right - left) / RobotConfig().track_width_m == pytest.approx(2.0, abs=0.15)


def test_telemetry_comes_in_order_and_on_time(robot: Robot) -> None:
    robot.run(150)
    times = [e.t_ns for e in robot.events if isinstance(e, WheelTravel | Contact)]
    assert times == sorted(times)
    for event in robot.of(WheelTravel)[20:]:
        assert isinstance(event, WheelTravel)
        assert 0 <= event.arrived_ns - event.t_ns <= 30_000_000


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
    for k in range(2):
        robot.run(50, 0.2)
        robot.cable.tear()
        robot.run(60, 0.2)  # it rolls until its order expires, and nobody hears of it
        assert robot.link_state == (False, "disconnected")
        assert robot.speed == pytest.approx([0.0, 0.0], abs=1e-3)
        robot.cable.cut = False
        robot.run(30)
        assert robot.link_state[0]
        assert robot.measured == pytest.approx(robot.travel, abs=0.0005)
        assert robot.link.counters.opened == robot.link.counters.sessions == k + 2
        robot.arm()


def test_a_reset_of_the_controller_goes_on_counting_and_stays_stopped(robot: Robot) -> None:
    robot.arm()
    robot.run(50, 0.2)
    robot.run(20, 0.0)
    before = robot.measured
    robot.reset()
    start = list(robot.travel)
    robot.run(60, 0.2)
    assert robot.link_state == (True, "reset")
    assert robot.travel == pytest.approx(start, abs=1e-6)
    robot.arm()
    robot.run(50, 0.2)
    robot.run(30, 0.0)
    rolled = [end - begin for end, begin in zip(robot.travel, start, strict=True)]
    gained = [end - begin for end, begin in zip(robot.measured, before, strict=True)]
    assert gained == pytest.approx(rolled, abs=0.001)


def test_a_dead_line_is_given_up_and_found_again(robot: Robot) -> None:
    robot.arm()
    robot.cable.dead = True
    robot.run(180)
    assert not robot.link.connected
    assert robot.link.problem
    assert robot.link.counters.opened == 2  # silent for 3 s: closed and opened again
    robot.cable.dead = False
    robot.run(25)
    assert robot.link_state[0]


def test_one_percent_of_noise_stops_nothing(robot: Robot) -> None:
    robot.arm()
    robot.cable.noise = Noise(random.Random(1), 0.0025, 0.0025, 0.0025, 0.0025)
    robot.run(250, 0.2)
    assert robot.link_state == (True, "")
    assert robot.speed[0] == pytest.approx(0.2, abs=0.02)
    assert robot.cable.noise.hurt > 100


def test_every_wait_is_in_the_histogram(robot: Robot) -> None:
    robot.arm()
    robot.run(100, 0.1)
    counters = robot.link.counters
    assert sum(counters.latency) >= 100
    assert counters.unsent == counters.refused == 0
    assert counters.retries == counters.crc_errors == counters.framing_errors == 0


def test_a_late_clear_does_not_undo_a_new_stop(robot: Robot) -> None:
    robot.arm()
    robot.run(20, 0.2)
    robot.pins = replace(robot.pins, bump_left=True)
    robot.run(5, 0.2)
    robot.pins = replace(robot.pins, bump_left=False)
    robot.wheels.send(ClearOrder(robot.now_ns, "test"))
    robot.wheels.send(StopOrder(robot.now_ns, "test"))
    robot.run(20, 0.2)
    assert robot.link_state == (True, "host")
