"""`sweeper check`: is this machine ready to drive? Every finding has a cause and a remedy."""

from __future__ import annotations

import os
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from robot.body.sources import open_calibration, open_depth, open_imu, open_stereo
from robot.config import Config
from robot.errors import HardwareError, SweeperError
from robot.hardware.wheels import WheelBridge, open_wheels, who
from robot.messages import LinkState, StopOrder

Finding = dict[str, str]
MIN_FREE_DISK_MB = 200
MIN_FREE_MEMORY_MB = 250
EARLIEST_CLOCK_S = 1_700_000_000  # a board without a battery clock wakes up long before this
THROTTLE_BITS = {
    0: "the supply voltage is too low",
    1: "the processor's frequency is capped",
    2: "the processor is throttled",
    16: "the supply voltage was too low since power-up",
    18: "the processor was throttled since power-up",
}


def check(config: Config) -> list[Finding]:
    """Run all checks; each finding is {"code", "level", "cause", "remedy"}."""
    checks: list[tuple[str, Callable[[Config], str]]] = [
        ("calibration", _calibration),
        ("model", _model),
        ("camera", _camera),
        ("wheels", _wheels),
        ("gyro", _gyro),
    ]
    findings = [_run(code, function, config) for code, function in checks]
    return [*findings, *_machine()]


def check_running(config: Config) -> list[Finding]:
    """What can be checked beside a running robot, whose devices are busy."""
    return [_run("calibration", _calibration, config), *_machine()]


def stop_motors(config: Config) -> str:
    """Latch a stop in the motor controller; returns a sentence. Raises HardwareError."""
    wheels = open_wheels(config.robot, config.link)
    asked = False
    try:
        for state in _link_states(wheels):
            if state.stop_reason and asked:
                return f"The motor controller has stopped: {state.stop_reason}."
            wheels.send(StopOrder(state.t_ns, "asked from the command line"))
            asked = True
    finally:
        wheels.close()
    raise _no_answer(config)


def _link_states(wheels: WheelBridge, timeout_s: float = 3.0) -> Iterator[LinkState]:
    """What the connected controller says of itself, for a while."""
    end_s = time.monotonic() + timeout_s
    while time.monotonic() < end_s:
        for event in wheels.poll(time.monotonic_ns()):
            if isinstance(event, LinkState) and event.connected:
                yield event
        time.sleep(0.01)


def _run(code: str, function: Callable[[Config], str], config: Config) -> Finding:
    try:
        return _finding(code, "ok", function(config), "")
    except SweeperError as error:
        cause, _, remedy = str(error).partition("; ")
        return _finding(code, "error", cause, remedy)


def _finding(code: str, level: str, cause: str, remedy: str) -> Finding:
    return {"code": code, "level": level, "cause": cause, "remedy": remedy}


def _no_answer(config: Config) -> HardwareError:
    return HardwareError(
        f"link.port = '{config.link.port or 'automatic'}': the motor controller does not answer; "
        "check its power and that its firmware is Sweeper's."
    )


def _calibration(config: Config) -> str:
    rectifier = open_calibration(config)
    return config.camera.calibration if rectifier else "frames are taken as already rectified"


def _model(config: Config) -> str:
    open_depth(config, config.camera.stereo_camera())
    return f"matcher {config.perception.matcher} is ready"


def _camera(config: Config) -> str:
    camera = open_stereo(config)
    try:
        if camera.read() is None:
            raise HardwareError(
                f"camera.device = '{config.camera.device}' delivers no frame; replug the camera."
            )
    finally:
        camera.close()
    return f"camera {config.camera.device} delivers frames"


def _wheels(config: Config) -> str:
    wheels = open_wheels(config.robot, config.link)
    try:
        if next(_link_states(wheels), None) is None:
            raise _no_answer(config)
    finally:
        wheels.close()
    return f"the motor controller answers: {who(wheels.link)}"


def _gyro(config: Config) -> str:
    imu = open_imu(config)
    return f"{imu.name} answers"


def _machine() -> Iterator[Finding]:
    free_mb = shutil.disk_usage(".").free // 2**20
    level = "ok" if free_mb >= MIN_FREE_DISK_MB else "error"
    yield _finding("disk", level, f"{free_mb} MB free", "delete old runs" if level != "ok" else "")
    available_mb = os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") // 2**20
    level = "ok" if available_mb >= MIN_FREE_MEMORY_MB else "warn"
    remedy = "" if level == "ok" else "stop other programs"
    yield _finding("memory", level, f"{available_mb} MB unused", remedy)
    wrong = time.time() < EARLIEST_CLOCK_S
    yield _finding(
        "clock",
        "warn" if wrong else "ok",
        "the wall clock is not set" if wrong else "the wall clock is set",
        "wait for network time, or run `timedatectl set-time`" if wrong else "",
    )
    yield from _throttling()


def _throttling(tool: str = "vcgencmd") -> Iterator[Finding]:
    """The Pi's own word on its power supply; absent on other machines."""
    if shutil.which(tool) is None and not Path("/dev/vcio").exists():
        return
    output = subprocess.run([tool, "get_throttled"], capture_output=True, text=True, check=False)
    bits = int(output.stdout.strip().partition("=")[2] or "0", 16)
    causes = [cause for bit, cause in THROTTLE_BITS.items() if bits >> bit & 1]
    yield _finding(
        "power",
        "warn" if causes else "ok",
        "; ".join(causes) or "supply and temperature are in order",
        "use a 5.1 V supply of 2.5 A or more, and cool the board" if causes else "",
    )
