"""Tell the motor controller to stop, and nothing else: the service's last word (ExecStopPost).

It imports little on purpose: on the board the numeric libraries take seconds to load.
"""

from __future__ import annotations

import time
from collections.abc import Iterator

from robot.config import Config
from robot.errors import HardwareError
from robot.hardware.wheels import WheelBridge, open_wheels
from robot.messages import LinkState, StopOrder

ANSWER_S = 3.0


def stop_motors(config: Config) -> str:
    """Latch a stop in the motor controller; returns a sentence. Raises HardwareError."""
    wheels = open_wheels(config.robot, config.link)
    asked = False
    try:
        for state in link_states(wheels):
            if state.stop_reason and asked:
                return f"The motor controller has stopped: {state.stop_reason}."
            wheels.send(StopOrder(state.t_ns, "asked from the command line"))
            asked = True
    finally:
        wheels.close()
    raise no_answer(config, wheels.link.problem)


def link_states(wheels: WheelBridge, timeout_s: float = ANSWER_S) -> Iterator[LinkState]:
    """What the connected controller says of itself, for a while."""
    end_s = time.monotonic() + timeout_s
    while time.monotonic() < end_s:
        for event in wheels.poll(time.monotonic_ns()):
            if isinstance(event, LinkState) and event.connected:
                yield event
        time.sleep(0.01)


def no_answer(config: Config, problem: str = "") -> HardwareError:
    """The error of a controller that keeps silent."""
    why = f" ({problem})" if problem else ""
    return HardwareError(
        f"link.port = '{config.link.port or 'automatic'}': the motor controller does not answer"
        f"{why}; check its power and that its firmware is Sweeper's."
    )
