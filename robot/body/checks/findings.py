"""The findings of `sweeper check`: stable codes, three levels, a cause and a remedy."""

from __future__ import annotations

Finding = dict[str, str]
CODES = (
    "camera",  # both eyes deliver pictures that can be used
    "sync",  # and are exposed at once
    "calibration",  # there is one, it fits, it is not stale, and the eyes stand as it says
    "model",  # the network is there and is the one of the manifest
    "serial",  # the motor controller answers
    "firmware",  # and runs the firmware of this version
    "i2c",  # the bus is there
    "imu",  # the gyro measures
    "battery",  # the gauge measures
    "groups",  # this user may open the devices
    "overlays",  # the board's start configuration names what is connected
    "disk",  # room, and writable
    "clock",  # the wall clock is set
    "throttling",  # heat
    "undervoltage",  # supply
    "memory",
)


def finding(code: str, level: str, cause: str, remedy: str = "") -> Finding:
    """One line of the report; `level` is ok, warn or error."""
    assert code in CODES and level in ("ok", "warn", "error")
    assert bool(remedy) == (level != "ok"), code
    return {"code": code, "level": level, "cause": cause, "remedy": remedy}


def ok(code: str, cause: str) -> Finding:
    """All is well."""
    return finding(code, "ok", cause)


def warn(code: str, cause: str, remedy: str) -> Finding:
    """It drives, but worse than it could, or not for long."""
    return finding(code, "warn", cause, remedy)


def error(code: str, problem: Exception | str, remedy: str = "") -> Finding:
    """It will not drive. An error's own sentence is split at its remedy."""
    cause, mark, rest = str(problem).partition("; ")
    if not mark:
        return finding(code, "error", cause, remedy or "see the log")
    return finding(code, "error", cause, remedy or rest)
