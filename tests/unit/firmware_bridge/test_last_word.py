"""Letting go of the port: a stop on its way is not left to chance."""

from __future__ import annotations

import time

from scripted_controller import ScriptedController

from firmware_bridge.link import Link
from firmware_bridge.messages import Stop
from firmware_bridge.transport import memory_pair
from robot.config import LinkConfig, RobotConfig
from robot.hardware.wheels import WheelBridge
from robot.messages import StopOrder


def test_a_last_stop_is_said_until_it_is_answered() -> None:
    near, far = memory_pair()
    controller = ScriptedController(far)
    bridge = WheelBridge(Link(near), RobotConfig(), LinkConfig())
    for _ in range(50):
        controller.run(time.monotonic_ns())
        bridge.poll(time.monotonic_ns())
    assert bridge.link.connected
    controller.mute = {Stop}
    bridge.send(StopOrder(0, "test"))
    bridge.close()
    controller.run(time.monotonic_ns())
    assert 3 <= controller.count(Stop) <= 6
