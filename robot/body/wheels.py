"""`sweeper wheels`: stop, monitor, drive, selftest, flash. For people at the robot."""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robot.errors import HardwareError

if TYPE_CHECKING:
    from firmware_bridge.live import Live
    from robot.config import Config

Result = tuple[int, dict[str, Any]]  # exit code, and what --json says
Function = Callable[[argparse.Namespace], int]
AddVerb = Callable[[Any, str, str, Function], argparse.ArgumentParser]
VALID_FOR_MS = 200
LONGEST_DRIVE_S = 30.0


def add_verbs(controls: Any, verb: AddVerb, write_json: Callable[[str | None, Any], None]) -> None:
    """The grammar of `sweeper wheels`."""

    def add(
        name: str, summary: str, function: Callable[[argparse.Namespace], Result]
    ) -> argparse.ArgumentParser:
        def run(arguments: argparse.Namespace) -> int:
            code, result = function(arguments)
            write_json(arguments.json, result)
            return code

        made = verb(controls, name, summary, run)
        made.add_argument("--config", type=Path, help="TOML file with differences to the defaults")
        return made

    add("stop", "stop the wheels at the motor controller and latch it", _stop)

    monitor = add("monitor", "show what is said on the line, or decode a capture of it", _monitor)
    monitor.add_argument("capture", nargs="?", type=Path, help="a file of raw bytes; no port then")
    monitor.add_argument("--seconds", type=float, default=float("inf"), help="end after this long")
    monitor.add_argument("--record", type=Path, help="keep the incoming bytes in this file")

    drive = add("drive", "drive for a moment, then stop and latch", _drive)
    drive.add_argument("v", type=float, metavar="M_PER_S", help="forward speed")
    drive.add_argument("yaw_rate", type=float, metavar="RAD_PER_S", help="to the left")
    drive.add_argument("--seconds", type=float, default=1.0, help=f"at most {LONGEST_DRIVE_S:.0f}")
    drive.add_argument("--clear", action="store_true", help="clear a latched stop first")

    selftest = add("selftest", "test controller, sensors and wheels; they turn a little", _selftest)
    selftest.add_argument("--yes", action="store_true", help="the floor around it is free")

    flash = add("flash", "write the controller's firmware with avrdude", _flash)
    flash.add_argument("--image", type=Path, metavar="HEX", help="default: build it here")
    flash.add_argument("--yes", action="store_true", help="do not ask")
    flash.add_argument("--force", action="store_true", help="even if the same build runs already")


def confirm(question: str) -> bool:
    """Ask somebody who sits at this terminal; nobody there means no."""
    if not sys.stdin.isatty():
        return False
    return input(f"{question} Type yes: ").strip().lower() == "yes"


def _open(config: Config, port: str = "") -> Live:
    """A link by hand. Raises HardwareError when there is no port or another program has it."""
    from firmware_bridge.live import Live
    from firmware_bridge.transport import SerialTransport
    from robot.hardware.wheels import make_link

    transport = SerialTransport(port or config.link.port, config.link.baud)
    if not transport.open():
        raise HardwareError(transport.problem)
    return Live(make_link(transport, config.link))


def _config(arguments: argparse.Namespace) -> Config:
    from robot.config import load_config

    return load_config(arguments.config)


def _stop(arguments: argparse.Namespace) -> Result:
    from robot.body.halt import stop_motors

    sentence = stop_motors(_config(arguments))
    if arguments.json != "-":
        print(sentence)
    return 0, {"stopped": True, "reason": sentence}


def _monitor(arguments: argparse.Namespace) -> Result:
    from firmware_bridge.console import decode_capture, monitor_port

    if arguments.capture is not None:
        try:
            data = arguments.capture.read_bytes()
        except OSError as error:
            raise HardwareError(f"{arguments.capture}: {error.strerror}; name a capture.") from None
        lines = list(decode_capture(data))
        print("\n".join(lines))
        return 0, {"lines": len(lines), "summary": lines[-1]}
    config = _config(arguments)
    end_s = time.monotonic() + arguments.seconds
    counters = monitor_port(
        config.link.port, config.link.baud, print, lambda: time.monotonic() >= end_s,
        arguments.record,
    )  # fmt: skip
    return 0, counters.as_dict()


def _drive(arguments: argparse.Namespace) -> Result:
    config = _config(arguments)
    if not 0.0 < arguments.seconds <= LONGEST_DRIVE_S:
        raise HardwareError(f"--seconds must be above 0 and at most {LONGEST_DRIVE_S:.0f}.")
    return drive(_open(config), config, arguments.v, arguments.yaw_rate, arguments.seconds,
                 clear=arguments.clear)  # fmt: skip


def drive(
    live: Live, config: Config, v_mps: float, yaw_rate_radps: float, seconds: float, *, clear: bool
) -> Result:
    """Drive, then stop; exit code 1 when a reflex has stopped it before."""
    from firmware_bridge.messages import TICKS_PER_METRE, Drive
    from robot.hardware.wheels import wheel_speeds

    left, right = wheel_speeds(
        v_mps, yaw_rate_radps, config.robot.track_width_m, config.link.max_wheel_mps
    )
    order = Drive(round(left * 1000), round(right * 1000), 0, 0, VALID_FOR_MS)
    try:
        live.connect()
        live.wait(0.1)
        if live.latched() and not (clear and live.clear()):
            remedy = "remove its cause" if clear else "pass --clear if it may drive"
            raise HardwareError(
                f"the controller is stopped ('{live.link.stop_reason.name.lower()}'); {remedy}."
            )
        start = live.ticks()
        cut_short = live.wait(seconds, order, until=live.latched)
        reason = live.link.stop_reason.name.lower() if cut_short else ""
        live.stop()
        live.wait(0.2)
        metres = [(e - s) / TICKS_PER_METRE for e, s in zip(live.ticks(), start, strict=True)]
    finally:
        live.stop()
        live.link.close()
    print(f"left {metres[0]:+.3f} m, right {metres[1]:+.3f} m" + (f"; {reason}" if reason else ""))
    return int(cut_short), {"left_m": metres[0], "right_m": metres[1], "stopped_by": reason}


def _selftest(arguments: argparse.Namespace) -> Result:
    from firmware_bridge.selftest import selftest

    config = _config(arguments)
    if not (arguments.yes or confirm("The wheels will turn by some centimetres.")):
        raise HardwareError("the self-test was not confirmed; say `yes`, or pass --yes.")
    live = _open(config)
    findings = []
    try:
        for finding in selftest(live):
            findings.append(finding)
            mark = "ok    " if finding.passed else "FAILED"
            remedy = "" if finding.passed else f": {finding.remedy}"
            print(f"{mark} {finding.name:12s} {finding.what}{remedy}")
    finally:
        live.link.close()
    passed = all(finding.passed for finding in findings)
    rows = [{"name": f.name, "passed": f.passed, "what": f.what} for f in findings]
    return int(not passed), {"passed": passed, "findings": rows}


def _flash(arguments: argparse.Namespace) -> Result:
    from firmware_bridge.board import build_image
    from firmware_bridge.flash import flash
    from firmware_bridge.host import build_number
    from firmware_bridge.transport import find_port

    config = _config(arguments)
    port = config.link.port or find_port()
    with tempfile.TemporaryDirectory() as folder:
        image, build = arguments.image, None
        if image is None:
            image = build_image(Path(folder)).with_suffix(".hex")
            build = build_number("atmega328p")
        done = flash(
            lambda: _open(config, port),
            image,
            build,
            port,
            force=arguments.force,
            confirm=lambda question: arguments.yes or confirm(question),
        )
    after = done.after.build if done.after else None
    said = "written" if done.written else "it runs already; nothing was written"
    print(f"{port}: build {after:08x}: {said}")
    return 0, {"written": done.written, "build": after}
