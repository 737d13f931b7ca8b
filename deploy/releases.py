"""From a checkout to a whole release: a virtual environment, and the files that belong to it."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from slots import sync_folder, write_whole

UNITS = (
    "sweeper.service", "sweeper-good.service", "sweeper-safe.service", "sweeper-serve.service",
    "sweeper-tidy.service", "sweeper-tidy.timer",
)  # fmt: skip
PLACED = {  # file in the source: where it goes
    "deploy/udev/99-sweeper.rules": "etc/udev/rules.d/99-sweeper.rules",
    "deploy/config/sysusers.conf": "usr/lib/sysusers.d/sweeper.conf",
    "deploy/config/journald.conf": "etc/systemd/journald.conf.d/sweeper.conf",
    "deploy/config/watchdog.conf": "etc/systemd/system.conf.d/sweeper.conf",
    **{f"systemd/{unit}": f"etc/systemd/system/{unit}" for unit in UNITS},
}
TOOLS = ("manage.py", "slots.py", "releases.py", "boot_config.py")
Build = Callable[[Path, Path], None]


class Refused(Exception):
    """One sentence for the person who installs."""


def add_release(releases: Path, source: Path, build: Build) -> str:
    """Build the release unless it is there whole; returns its name."""
    name = release_name(source)
    folder = releases / name
    if not (folder / ".complete").is_file():
        shutil.rmtree(folder, ignore_errors=True)
        releases.mkdir(parents=True, exist_ok=True)
        build(source, folder)
        carried = {f"deploy/{tool}": f"deploy/{tool}" for tool in TOOLS}
        carried |= {origin: f"placed/{place}" for origin, place in PLACED.items()}
        carried["deploy/README.md"] = "README.md"
        for origin, place in carried.items():
            (folder / place).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source / origin, folder / place)
        sync_tree(folder)
        write_whole(folder / ".complete", b"")
    return name


def release_name(source: Path) -> str:
    """Version and a hash of all that is installed: the same source has the same name."""
    try:
        text = (source / "pyproject.toml").read_text(encoding="utf-8")
    except OSError:
        raise Refused(f"{source} is no checkout of Sweeper; name one.") from None
    version = next(
        (line.split('"')[1] for line in text.splitlines() if line.startswith("version = ")), "0"
    )
    digest = hashlib.sha256(text.encode())
    for part in ("robot", "firmware_bridge", "models", "deploy", "systemd"):
        for path in sorted((source / part).rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts:
                digest.update(str(path.relative_to(source)).encode() + path.read_bytes())
    return f"{version}-{digest.hexdigest()[:10]}"


def build_venv(source: Path, folder: Path) -> None:
    """A virtual environment with Sweeper in it. libcamera stays with the system's own Python."""
    python = os.environ.get("PYTHON", sys.executable)
    options = os.environ.get("PIP_OPTIONS", "").split()
    for command in (
        [python, "-m", "venv", str(folder)],
        [str(folder / "bin/pip"), "install", "--quiet", *options, f"{source}[web,mqtt]"],
    ):
        if subprocess.run(command, check=False).returncode != 0:
            raise Refused(f"`{' '.join(command)}` failed; see above, and try again.")


def sync_tree(folder: Path) -> None:
    """Bring every file of a release to the card before anything points to it."""
    for path in sorted(folder.rglob("*")):
        if path.is_file() and not path.is_symlink():
            descriptor = os.open(path, os.O_RDONLY)
            try:
                os.fsync(descriptor)
            finally:
                os.close(descriptor)
    for path in [folder, *(p for p in folder.rglob("*") if p.is_dir() and not p.is_symlink())]:
        sync_folder(path)
