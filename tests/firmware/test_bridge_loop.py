"""The bridge in lock-step with the host firmware: exact times, one life like the other."""

from __future__ import annotations

import random
from collections.abc import Iterator
from pathlib import Path

import pytest
from bridge_robot import TICK_NS, HostBoard, Noise, Robot

from robot.messages import WheelTravel


@pytest.fixture
def robot(firmware_binary: Path) -> Iterator[Robot]:
    """A robot on the host firmware."""
    made = Robot(HostBoard(firmware_binary))
    yield made
    made.close()


def test_times_are_exact_in_lock_step(robot: Robot) -> None:
    robot.run(200)
    for event in robot.of(WheelTravel)[2:]:
        assert isinstance(event, WheelTravel)
        assert abs(event.t_ns - event.arrived_ns) <= 2
        assert event.arrived_ns % TICK_NS == 0


def test_the_same_life_twice(firmware_binary: Path) -> None:
    lives = []
    for _ in range(2):
        robot = Robot(HostBoard(firmware_binary))
        robot.arm()
        robot.cable.noise = Noise(random.Random(1), flipped=0.002)
        robot.run(300, 0.2, yaw_rate=0.3)
        lives.append(robot.events)
        robot.close()
    assert lives[0] == lives[1]
