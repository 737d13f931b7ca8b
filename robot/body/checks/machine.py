"""Checks of the board itself: rights, start configuration, card, clock, heat, supply, memory."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from robot.body.checks.findings import Finding, error, finding, ok, warn
from robot.config import Config

MIN_FREE_DISK_MB = 200
MIN_FREE_MEMORY_MB = 250
EARLIEST_CLOCK_S = 1_700_000_000  # a board without a battery clock wakes up long before this
GROUPS = {"video": "cameras", "dialout": "the motor controller", "i2c": "the sensors"}
# Bits of the firmware's get_throttled: now, and since power-up (16 higher).
HEAT_BITS = {1: "the frequency is capped", 2: "it is throttled", 3: "it is near its heat limit"}
SINCE = 16
SUPPLY_REMEDY = "use a 5.1 V supply of 2.5 A or more with short, thick leads"
HEAT_REMEDY = "cool the board: a heat sink, air, or camera.rate_hz a little lower"


def state_folder() -> Path:
    """Where the service keeps its runs; the present folder where no service is installed."""
    named = os.environ.get("STATE_DIRECTORY")
    installed = Path("/var/lib/sweeper")
    return Path(named) if named else installed if installed.is_dir() else Path()


def _vcgencmd() -> str:
    if shutil.which("vcgencmd") is None:
        return ""
    done = subprocess.run(
        ["vcgencmd", "get_throttled"], capture_output=True, text=True, check=False, timeout=5
    )
    return done.stdout.strip().partition("=")[2]


@dataclass(frozen=True)
class Machine:
    """Where the checks look; tests give a folder of files instead of the real root."""

    root: Path = Path("/")
    state: Path = field(default_factory=state_folder)
    throttled: Callable[[], str] = _vcgencmd
    clock_s: Callable[[], float] = time.time
    uid: int = field(default_factory=os.geteuid)
    groups: tuple[int, ...] = field(default_factory=lambda: tuple(os.getgroups()))

    def text(self, *names: str) -> str | None:
        """The first of these files that can be read; None when none can."""
        for name in names:
            try:
                return (self.root / name.lstrip("/")).read_text(encoding="utf-8", errors="replace")
            except OSError:
                continue
        return None


def check_machine(config: Config, machine: Machine) -> Iterator[Finding]:
    """All of them; none raises."""
    yield _groups(machine)
    yield _overlays(config, machine)
    yield _disk(machine)
    yield _clock(machine)
    yield from _power(machine)
    yield _memory(machine)


def _groups(machine: Machine) -> Finding:
    lines = (machine.text("/etc/group") or "").splitlines()
    known = {p[0]: p for line in lines if len(p := line.split(":")) == 4}
    if machine.uid == 0:
        return ok("groups", "root may open everything")
    missing = [
        f"{name} ({what})"
        for name, what in GROUPS.items()
        if name in known and int(known[name][2]) not in machine.groups
    ]
    if missing:
        names = ",".join(m.split()[0] for m in missing)
        return warn(
            "groups",
            f"this user is not in the group{'s' if len(missing) > 1 else ''} {', '.join(missing)}",
            f"`sudo usermod -aG {names} $USER`, then log in again (the service has them)",
        )
    return ok("groups", "this user may open the devices")


def _overlays(config: Config, machine: Machine) -> Finding:
    text = machine.text("/boot/firmware/config.txt", "/boot/config.txt")
    if text is None:
        return ok("overlays", "no /boot/firmware/config.txt: this is no Raspberry Pi")
    lines = [line.partition("#")[0].strip() for line in text.splitlines()]
    missing = []
    if not any(re.fullmatch(r"dtparam=i2c(_arm)?(=on)?(,.*)?", line) for line in lines):
        missing.append("dtparam=i2c_arm=on")
    automatic = "camera_auto_detect=1" in lines
    sensors = [line for line in lines if re.match(r"dtoverlay=(ov|imx|arducam)", line)]
    if config.camera.source.startswith("libcamera") and not (automatic or sensors):
        missing.append("camera_auto_detect=1 (or dtoverlay=... of your camera)")
    if missing:
        return warn(
            "overlays",
            f"/boot/firmware/config.txt lacks {' and '.join(missing)}",
            "add it and start the board again; `deploy/install.sh` does both",
        )
    return ok("overlays", "I2C" + (" and cameras" if automatic or sensors else "") + " enabled")


def _disk(machine: Machine) -> Finding:
    free_mb = shutil.disk_usage(machine.state).free // 2**20
    if not os.access(machine.state, os.W_OK):
        return error(
            "disk",
            f"{machine.state.resolve()} cannot be written",
            "a card that failed turns read-only: replace it, or correct the owner",
        )
    if free_mb < MIN_FREE_DISK_MB:
        return error("disk", f"{free_mb} MB free", "delete old runs: `sweeper log tidy DIR`")
    return ok("disk", f"{free_mb} MB free")


def _clock(machine: Machine) -> Finding:
    if machine.clock_s() < EARLIEST_CLOCK_S:
        return warn(
            "clock",
            "the wall clock is not set: schedules and the names of runs will be wrong",
            "wait for network time, or run `timedatectl set-time`",
        )
    return ok("clock", "the wall clock is set")


def _power(machine: Machine) -> Iterator[Finding]:
    bits = _throttle_bits(machine)
    if bits is None:
        yield ok("throttling", "this board does not tell")
        yield ok("undervoltage", "this board does not tell")
        return
    now = [cause for bit, cause in HEAT_BITS.items() if bits >> bit & 1]
    before = [cause for bit, cause in HEAT_BITS.items() if bits >> (bit + SINCE) & 1]
    if now or before:
        when = "" if now else " (earlier, since power-up)"
        yield warn("throttling", ", ".join(now or before) + when, HEAT_REMEDY)
    else:
        yield ok("throttling", "full speed since power-up")
    if bits & 1 or bits >> SINCE & 1:
        when = "" if bits & 1 else " earlier, since power-up"
        yield finding(
            "undervoltage",
            "error" if bits & 1 else "warn",
            f"the supply voltage is too low{when}",
            SUPPLY_REMEDY,
        )
    else:
        yield ok("undervoltage", "the supply has kept its voltage")


def _throttle_bits(machine: Machine) -> int | None:
    """The firmware's word (sysfs first: a service may not reach /dev/vcio), else the kernel's."""
    said = machine.text("/sys/devices/platform/soc/soc:firmware/get_throttled")
    said = said if said is not None else machine.throttled()
    try:
        return int(said.strip(), 16)
    except ValueError:
        pass
    for folder in sorted((machine.root / "sys/class/hwmon").glob("hwmon*")):
        if (machine.text(f"/sys/class/hwmon/{folder.name}/name") or "").strip() == "rpi_volt":
            alarm = machine.text(f"/sys/class/hwmon/{folder.name}/in0_lcrit_alarm") or "0"
            return 1 if alarm.strip() == "1" else 0
    return None


def _memory(machine: Machine) -> Finding:
    match = re.search(r"^MemAvailable:\s+(\d+) kB", machine.text("/proc/meminfo") or "", re.M)
    if match is None:
        return ok("memory", "this system does not tell")
    available_mb = int(match.group(1)) // 1024
    if available_mb < MIN_FREE_MEMORY_MB:
        return warn("memory", f"{available_mb} MB available", "stop other programs")
    return ok("memory", f"{available_mb} MB available")
