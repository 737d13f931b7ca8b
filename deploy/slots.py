#!/usr/bin/python3
"""Which release runs, and the way back. Needs nothing but the system's Python and this file.

    slots.py count | good          what the service calls: a start, a good minute
    slots.py status | rollback     what a person calls
    (each with --root DIR: inside a folder, and no service is touched)

Layout under /opt/sweeper: `releases/<version>-<hash>/` (a virtual environment each; `.complete` is
there when it is whole), `current` and `previous` (links to the release that runs and the last good
one), `trial` (there while `current` is not yet known to be good: release and number of starts),
`history.log`, and `boot/slots.py`, the copy that the service calls: it comes from the last *good*
release, so a broken one cannot break the way back. At every moment `current` points to a whole
release or does not exist.

A release carries its units and rules in `placed/`, laid out as on the card. They are compared at
each start, so that whatever a power cut or a rollback left, they come to fit the release that runs.
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

STARTS_ON_TRIAL = 3
KEPT_HISTORY = 200
SERVICES = ("sweeper.service", "sweeper-serve.service", "sweeper-tidy.timer")


def write_whole(path: Path, data: bytes, mode: int = 0o644) -> None:
    """Replace a file so that it is the old or the new one, whenever the power goes."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{path.name}.partial")
    with open(partial, "wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    os.chmod(partial, mode)
    os.replace(partial, path)
    sync_folder(path.parent)


def point(link: Path, target: str) -> None:
    """Let `link` point to `target`, in one step."""
    partial = link.with_name(f".{link.name}.partial")
    if os.path.lexists(partial):
        os.unlink(partial)
    os.symlink(target, partial)
    os.replace(partial, link)
    sync_folder(link.parent)


def sync_folder(folder: Path) -> None:
    """Bring the folder's names to the card."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def systemctl(*arguments: str) -> None:
    """Only on a real system."""
    subprocess.run(["systemctl", *arguments], check=False)


class Slots:
    """The releases under one root."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.home = root / "opt/sweeper"
        self.releases = self.home / "releases"
        self.current, self.previous = self.home / "current", self.home / "previous"
        self.trial, self.boot = self.home / "trial", self.home / "boot/slots.py"

    # ------------------------------------------------------------ what is there

    def release(self, link: Path) -> str:
        """Name of the whole release that a link points to; empty when there is none."""
        try:
            name = Path(os.readlink(link)).name
        except OSError:
            return ""
        return name if (self.releases / name / ".complete").is_file() else ""

    def on_trial(self) -> int | None:
        """Starts of the current release so far, or None when it is known to be good."""
        try:
            noted = json.loads(self.trial.read_text(encoding="utf-8"))
            release, starts = str(noted["release"]), int(noted["starts"])
        except (OSError, ValueError, KeyError, TypeError):
            return None
        return starts if release == self.release(self.current) else None

    def status(self) -> None:
        """Print it as JSON."""
        print(json.dumps({
            "current": self.release(self.current), "previous": self.release(self.previous),
            "trial_starts": self.on_trial(),
        }))  # fmt: skip

    def note(self, sentence: str) -> None:
        """Say it and add it to the history."""
        print(f"sweeper: {sentence}", flush=True)
        history = self.home / "history.log"
        stamp = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
        old = history.read_text(encoding="utf-8").splitlines() if history.is_file() else []
        lines = [*old[-KEPT_HISTORY + 1 :], f"{stamp} {sentence}"]
        write_whole(history, ("\n".join(lines) + "\n").encode())

    # ------------------------------------------------------------ forth

    def begin(self, name: str) -> None:
        """The first release of a card."""
        self.take_boot_tool(name)
        point(self.current, f"releases/{name}")
        self.place()
        self.note(f"installed {name}")

    def switch(self, name: str) -> None:
        """Put a release on trial. The order matters: first the way back, then the new one."""
        if not self.boot.is_file():
            self.take_boot_tool(name)
        running = self.release(self.current)
        if running and self.on_trial() is None:
            point(self.previous, f"releases/{running}")
        write_whole(self.trial, json.dumps({"release": name, "starts": 0}).encode())
        point(self.current, f"releases/{name}")
        self.place()
        self.note(f"{name} is on trial; {self.release(self.previous) or 'nothing'} is the way back")
        self.forget_others()

    def place(self) -> bool:
        """Units and rules of the current release to their places; True when any was another."""
        changed = False
        carried = self.releases / self.release(self.current) / "placed"
        for origin in sorted(p for p in carried.rglob("*") if p.is_file()):
            data, target = origin.read_bytes(), self.root / origin.relative_to(carried)
            if not target.is_file() or target.read_bytes() != data:
                write_whole(target, data)
                changed = True
        return changed

    def take_boot_tool(self, name: str) -> None:
        """The copy of this file that counts starts and rolls back."""
        tool = self.releases / name / "deploy/slots.py"
        write_whole(self.boot, tool.read_bytes(), 0o755)

    def forget_others(self) -> None:
        """Keep two slots: what runs, and the way back."""
        kept = {self.release(self.current), self.release(self.previous)}
        for folder in sorted(self.releases.iterdir()):
            if folder.name not in kept:
                # First it is no whole release any more; a half-removed one must not look like one.
                (folder / ".complete").unlink(missing_ok=True)
                sync_folder(folder)
                shutil.rmtree(folder, ignore_errors=True)

    # ------------------------------------------------------------ the trial, and back

    def count(self) -> bool:
        """The service is about to start: after three starts without a good minute, go back.

        True when units have changed, and systemd must read them again.
        """
        starts = self.on_trial()
        if not self.release(self.current) and self.release(self.previous):
            self.go_back("the current release is damaged")
        elif starts is not None and starts >= STARTS_ON_TRIAL:
            self.go_back(f"{starts} starts without a good minute")
        elif starts is not None:
            noted = {"release": self.release(self.current), "starts": starts + 1}
            write_whole(self.trial, json.dumps(noted).encode())
        return self.place()

    def go_back(self, why: str) -> None:
        """To the last good release."""
        bad, name = self.release(self.current), self.release(self.previous)
        if not name or name == bad:
            self.note(f"{why}, but there is no earlier release to go back to")
            return
        point(self.current, f"releases/{name}")
        self.trial.unlink(missing_ok=True)
        self.note(f"rolled back from {bad or 'nothing'} to {name}: {why}")

    def good(self) -> None:
        """The service ran for a minute: the trial is over."""
        if self.on_trial() is None:
            return
        name = self.release(self.current)
        self.take_boot_tool(name)
        self.trial.unlink(missing_ok=True)
        sync_folder(self.home)
        self.note(f"{name} is good")


def main(arguments: list[str] | None = None) -> int:
    """Exit code 2 with one sentence when something is wrong."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("verb", choices=("count", "good", "rollback", "status"))
    parser.add_argument("--root", type=Path, default=Path("/"))
    given = parser.parse_args(arguments)
    slots, real = Slots(given.root), given.root == Path("/")
    try:
        if given.verb == "rollback":
            slots.go_back("asked for")
            slots.place()
            if real:
                systemctl("daemon-reload")
                systemctl("reset-failed", "sweeper.service")
                systemctl("restart", *SERVICES)
        elif given.verb == "count":
            if slots.count() and real:
                systemctl("daemon-reload")
        elif given.verb == "good":
            slots.good()
        else:
            slots.status()
    except OSError as error:
        print(f"slots.py: {error}; as root?", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
