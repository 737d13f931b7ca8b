#!/usr/bin/python3
"""Installs, updates and removes Sweeper. Needs nothing but the system's Python.

    manage.py install SOURCE [--root DIR]   a first installation, or again: each step is idempotent
    manage.py update SOURCE [--root DIR]    into a second slot; it is on trial until it ran a minute
    manage.py uninstall [--purge]           settings and maps stay, unless purged

`slots.py` says what is where, and keeps the way back. With --root everything happens inside DIR
and no service is touched.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
from pathlib import Path

import boot_config
from releases import PLACED, Build, Refused, add_release, build_venv
from slots import SERVICES, Slots, systemctl, write_whole

ENABLED = (*SERVICES, "sweeper-good.service")


def install(slots: Slots, source: Path, build: Build) -> None:
    """Everything that a fresh card needs; what is there already is left as it is."""
    name = add_release(slots.releases, source, build)
    settings = slots.root / "etc/sweeper/robot.toml"
    if not settings.exists():
        write_whole(settings, (source / "deploy/config/robot.toml").read_bytes())
    boot_config.enter(slots.root)
    running = slots.release(slots.current)
    if not running:
        slots.begin(name)
    elif name != running:
        slots.switch(name)
    else:
        slots.place()


def update(slots: Slots, source: Path, build: Build) -> None:
    """The new release beside the old one, then on trial."""
    if not slots.release(slots.current):
        raise Refused("nothing is installed yet; use install.")
    name = add_release(slots.releases, source, build)
    if name == slots.release(slots.current):
        print(f"sweeper: {name} runs already; nothing to do.")
        return
    boot_config.enter(slots.root)
    slots.switch(name)


def uninstall(slots: Slots, purge: bool) -> None:
    """Remove what was installed; settings and maps stay unless `purge`."""
    for place in PLACED.values():
        (slots.root / place).unlink(missing_ok=True)
    boot_config.leave(slots.root)
    shutil.rmtree(slots.home, ignore_errors=True)
    if purge:
        for name in ("etc/sweeper", "var/lib/sweeper", "var/lib/private/sweeper"):
            path = slots.root / name
            path.unlink() if path.is_symlink() else shutil.rmtree(path, ignore_errors=True)


def start_services() -> None:
    """What a running system must be told after a change."""
    for command in (["systemd-sysusers"], ["udevadm", "control", "--reload"],
                    ["udevadm", "trigger"]):  # fmt: skip
        subprocess.run(command, check=False)
    systemctl("daemon-reload")
    systemctl("enable", *ENABLED)
    systemctl("restart", "systemd-journald.service")
    systemctl("reset-failed", "sweeper.service")
    systemctl("restart", *SERVICES)


def main(arguments: list[str] | None = None, build: Build = build_venv) -> int:
    """Exit code 2 with one sentence when something is wrong."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("verb", choices=("install", "update", "uninstall"))
    parser.add_argument("source", nargs="?", type=Path, help="a checkout (install, update)")
    parser.add_argument("--root", type=Path, default=Path("/"))
    parser.add_argument("--purge", action="store_true", help="uninstall: settings and maps, too")
    given = parser.parse_args(arguments)
    slots, real = Slots(given.root), given.root == Path("/")
    try:
        if real and os.geteuid() != 0:
            raise Refused("this needs root; put sudo before it, or give --root DIR.")
        if given.verb == "uninstall":
            if real:
                systemctl("disable", "--now", *ENABLED)
            uninstall(slots, given.purge)
            if real:
                systemctl("daemon-reload")
            return 0
        if given.source is None:
            raise Refused(f"{given.verb} needs the path of a checkout.")
        {"install": install, "update": update}[given.verb](slots, given.source.resolve(), build)
        if real:
            start_services()
    except (Refused, OSError) as error:
        print(f"manage.py: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
