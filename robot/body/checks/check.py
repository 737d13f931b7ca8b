"""`sweeper check`: is this machine ready to drive? Every finding has a cause and a remedy.

The codes are stable: `CODES` lists them, the service's status uses the same ones.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from robot.body.checks.devices import (
    check_battery,
    check_calibration,
    check_cameras,
    check_controller,
    check_i2c,
    check_imu,
    check_model,
)
from robot.body.checks.findings import CODES, Finding, error, ok
from robot.body.checks.machine import Machine, check_machine
from robot.config import Config
from robot.errors import SweeperError

DEVICES: tuple[tuple[str, Callable[[Config], Iterator[Finding]]], ...] = (
    ("calibration", check_calibration),
    ("model", check_model),
    ("camera", check_cameras),
    ("serial", check_controller),
    ("i2c", check_i2c),
    ("imu", check_imu),
    ("battery", check_battery),
)


def check(config: Config, machine: Machine | None = None) -> list[Finding]:
    """Run all checks, in the order of `CODES`."""
    findings: list[Finding] = []
    for code, function in DEVICES:
        findings += _guarded(code, function, config)
    return in_order([*findings, *check_machine(config, machine or Machine())])


def check_running(config: Config, exact: str = "") -> list[Finding]:
    """What can be checked beside a running robot, whose devices are busy.

    `exact` says why its eyes need no calibration, if they need none.
    """
    machine = check_machine(config, Machine())
    if exact:
        return in_order([ok("calibration", exact), *machine])
    return in_order([*_guarded("calibration", check_calibration, config), *machine])


def in_order(findings: list[Finding]) -> list[Finding]:
    """By code; of several with one code the worst first."""
    levels = ("error", "warn", "ok")
    return sorted(findings, key=lambda f: (CODES.index(f["code"]), levels.index(f["level"])))


def _guarded(
    code: str, function: Callable[[Config], Iterator[Finding]], config: Config
) -> list[Finding]:
    try:
        return list(function(config))
    except SweeperError as problem:
        return [error(code, problem)]
