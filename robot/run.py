"""The only loop."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from robot.messages import StopOrder

if TYPE_CHECKING:
    from robot.body.base import Body, EventLog
    from robot.brain import Brain


def never() -> str:
    """Nobody asks for an early end."""
    return ""


def run(body: Body, brain: Brain, log: EventLog, ended: Callable[[], str] = never) -> None:
    """Let the brain live in the body until the body's events end, or `ended` says who wants that.

    Whatever goes wrong, the wheels are told to stop and the log is flushed before the error
    travels on.
    """
    t_ns = 0
    try:
        for event in body.events():
            if who := ended():
                body.send(StopOrder(t_ns, f"ended by {who}"))
                break
            t_ns = event.t_ns
            log.event(event)
            for command in brain.on(event):
                log.command(command)
                body.send(command)
    except BaseException:
        body.send(StopOrder(t_ns, "the control loop ended with an error"))
        raise
    finally:
        log.flush()
