"""`sweeper check --bundle FILE`: what a helper needs to see, without secrets and without images.

Only text goes in, file by file from a list; whatever looks like a password, a key, an address or a
serial number is blanked on the way.
"""

from __future__ import annotations

import io
import json
import platform
import re
import subprocess
import tarfile
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

from robot.body.checks.findings import Finding
from robot.body.checks.machine import Machine
from robot.body.kept.store import write_whole
from robot.config import Config, dump_config
from robot.errors import SweeperError

MAX_BYTES = 400_000  # of one text; the end is kept, as the newest is there
RUNS = 10
FILES = (
    "/etc/os-release", "/boot/firmware/config.txt", "/boot/firmware/cmdline.txt", "/proc/cpuinfo",
    "/proc/meminfo", "/proc/mounts", "/proc/uptime", "/proc/version",
    "/proc/device-tree/model", "/opt/sweeper/history.log",
)  # fmt: skip
COMMANDS = {
    "journal.txt": ["journalctl", "--no-pager", "-o", "short-iso", "-n", "3000",
                    "-u", "sweeper", "-u", "sweeper-serve", "-u", "sweeper-safe"],
    "service.txt": ["systemctl", "status", "--no-pager", "-l", "sweeper", "sweeper-serve"],
    "kernel.txt": ["journalctl", "--no-pager", "-k", "-n", "1500"],
    "usb.txt": ["lsusb"],
    "cameras.txt": ["cam", "--list"],
}  # fmt: skip
PACKAGES = ("sweeper", "numpy", "opencv-python-headless", "onnxruntime", "filterpy", "pyserial",
            "smbus2", "mcap", "msgspec")  # fmt: skip
_SECRETS = (
    (re.compile(r"(?i)\b(pass(word|wd|phrase)?|psk|secret|token|api_?key|key|ssid|user(name)?)"
                r"(\"?\s*[=:]\s*\"?)[^\s\",]+"), r"\1\4***"),
    (re.compile(r"(?i)\b(authorization|bearer|basic)\b[:\s]+((bearer|basic)\s+)?\S+"), r"\1 ***"),
    (re.compile(r"\b[a-z][a-z0-9+.-]*://[^\s/@:]+:[^\s/@]+@"), "***://***@"),
    (re.compile(r"(?i)\b([0-9a-f]{2}:){5}[0-9a-f]{2}\b"), "**:**:**:**:**:**"),
    (re.compile(r"\b(?!127\.0\.0\.1\b)(\d{1,3}\.){3}\d{1,3}\b"), "*.*.*.*"),
    (re.compile(r"(?i)\b[0-9a-f]{1,4}(:[0-9a-f]{0,4}){4,7}\b"), "*::*"),
    (re.compile(r"(?m)^(Serial\s*:\s*)\w+"), r"\1***"),
    (re.compile(r"(/home/)[^/\s]+"), r"\1***"),
    (re.compile(r"(?s)-----BEGIN [A-Z ]+-----.*?-----END [A-Z ]+-----"), "***"),
)  # fmt: skip


def blank(text: str) -> str:
    """The text without what nobody else should read."""
    host = platform.node()
    for pattern, instead in _SECRETS:
        text = pattern.sub(instead, text)
    return re.sub(rf"\b{re.escape(host)}\b", "***", text) if len(host) > 2 else text


def write_bundle(
    target: Path, config: Config, findings: list[Finding], machine: Machine
) -> list[str]:
    """Write the .tar.gz and return the names in it. Raises SweeperError."""
    buffer = io.BytesIO()
    names = []
    with tarfile.open(fileobj=buffer, mode="w:gz") as archive:
        for name, text in _texts(config, findings, machine):
            data = blank(text).encode()[-MAX_BYTES:]
            entry = tarfile.TarInfo(f"sweeper/{name}")
            entry.size = len(data)
            archive.addfile(entry, io.BytesIO(data))
            names.append(name)
    try:
        write_whole(target, buffer.getvalue())
    except OSError as problem:
        raise SweeperError(
            f"--bundle {target}: cannot be written ({problem.strerror}); give a writable path."
        ) from None
    return names


def _texts(config: Config, findings: list[Finding], machine: Machine) -> Iterator[tuple[str, str]]:
    yield "check.json", json.dumps({"checks": findings}, indent=2)
    yield "config.toml", dump_config(config)
    yield "versions.txt", "\n".join(_versions())
    if config.camera.calibration:
        yield "calibration.txt", machine.text(config.camera.calibration) or "cannot be read"
    for file in FILES:
        if (text := machine.text(file)) is not None:
            yield file.strip("/").replace("/", "_"), text
    for name, command in COMMANDS.items():
        if (text := _said(command)) is not None:
            yield name, text
    yield from _runs(machine.state)


def _runs(state: Path) -> Iterator[tuple[str, str]]:
    """Summaries of the newest runs, and what lies where with its size."""
    runs = state / "runs"
    summaries = sorted(runs.glob("*/summary.json"), key=lambda p: p.parent.name)
    for path in summaries[-RUNS:]:
        try:
            yield f"runs/{path.parent.name}.json", path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError):
            continue
    sizes = [
        f"{path.stat().st_size:>12} {path.relative_to(state)}"
        for path in sorted([*state.glob("*"), *runs.rglob("*")])
        if path.is_file() and not path.is_symlink()
    ]
    yield "files.txt", "\n".join(sizes)


def _versions() -> Iterator[str]:
    yield f"python {platform.python_version()} {platform.machine()} {platform.release()}"
    for name in PACKAGES:
        try:
            yield f"{name} {metadata.version(name)}"
        except metadata.PackageNotFoundError:
            yield f"{name} -"


def _said(command: list[str]) -> str | None:
    """What a command prints; None where there is no such command."""
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, errors="replace", check=False, timeout=20
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout + done.stderr
