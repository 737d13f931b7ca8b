#!/usr/bin/python3
"""Installs, updates, rolls back and removes Sweeper. Needs nothing but the system's Python.

    manage.py install SOURCE [--root DIR]   a first installation, or again: each step is idempotent
    manage.py update SOURCE [--root DIR]    into a second slot; it is on trial until it ran a minute
    manage.py count | good | rollback       what the service calls: a start, a good minute, by hand
    manage.py status | uninstall [--purge]

Layout under /opt/sweeper: `releases/<version>-<hash>/` (a virtual environment each), `current` and
`previous` (links to the release that runs and the last good one), `trial` (there while `current`
is not yet known to be good: release and number of starts), `history.log`, and `boot/manage.py`,
the copy that the service calls: it comes from the last *good* release, so a broken one cannot
break the way back. At every moment `current` points to a whole release or does not exist.

With --root everything happens inside DIR and no service is touched.
"""

from __future__ import annotations

import argparse
import datetime
import hashlib
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

STARTS_ON_TRIAL = 3
KEPT_HISTORY = 200
CONFIG_TXT = """\
dtparam=i2c_arm=on,i2c_arm_baudrate=400000
camera_auto_detect=1
# Start button between GPIO 17 and ground; buzzer (through a transistor) on GPIO 18.
dtoverlay=gpio-key,gpio=17,active_low=1,gpio_pull=up,keycode=148,label=sweeper-start
dtoverlay=gpio-led,gpio=18,label=buzzer
# The firmware's own watchdog restarts a board that hangs (at most 15 s).
dtparam=watchdog=on
"""
BEGIN, END = "# sweeper: begin", "# sweeper: end"
UNITS = (
    "sweeper.service", "sweeper-good.service", "sweeper-safe.service", "sweeper-serve.service",
    "sweeper-tidy.service", "sweeper-tidy.timer",
)  # fmt: skip
ENABLED = ("sweeper.service", "sweeper-good.service", "sweeper-serve.service", "sweeper-tidy.timer")
PLACED = {  # file in the source: where it goes
    "deploy/udev/99-sweeper.rules": "etc/udev/rules.d/99-sweeper.rules",
    "deploy/config/sysusers.conf": "usr/lib/sysusers.d/sweeper.conf",
    "deploy/config/journald.conf": "etc/systemd/journald.conf.d/sweeper.conf",
    "deploy/config/watchdog.conf": "etc/systemd/system.conf.d/sweeper.conf",
    **{f"systemd/{unit}": f"etc/systemd/system/{unit}" for unit in UNITS},
}
Build = Callable[[Path, Path], None]


class Refused(Exception):
    """One sentence for the person who installs."""


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


class Home:
    """The installation under one root."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.home = root / "opt/sweeper"
        self.releases = self.home / "releases"
        self.current, self.previous = self.home / "current", self.home / "previous"
        self.trial, self.boot = self.home / "trial", self.home / "boot/manage.py"

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

    def note(self, sentence: str) -> None:
        """Say it and add it to the history."""
        print(f"sweeper: {sentence}", flush=True)
        history = self.home / "history.log"
        stamp = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
        old = history.read_text(encoding="utf-8").splitlines() if history.is_file() else []
        lines = [*old[-KEPT_HISTORY + 1 :], f"{stamp} {sentence}"]
        write_whole(history, ("\n".join(lines) + "\n").encode())

    # ------------------------------------------------------------ install, update

    def install(self, source: Path, build: Build) -> None:
        """Everything that a fresh card needs; what is there already is left as it is."""
        first = not self.release(self.current)
        name = self.add_release(source, build)
        self.place_files(source)
        if not self.boot.is_file():
            self.take_boot_tool(source)
        if first:
            point(self.current, f"releases/{name}")
            self.note(f"installed {name}")
        elif name != self.release(self.current):
            self.switch(name)

    def update(self, source: Path, build: Build) -> None:
        """The new release beside the old one, then on trial."""
        if not self.release(self.current):
            raise Refused("nothing is installed yet; use install.")
        name = self.add_release(source, build)
        if name == self.release(self.current):
            print(f"sweeper: {name} runs already; nothing to do.")
            return
        self.place_files(source)
        self.switch(name)

    def add_release(self, source: Path, build: Build) -> str:
        """Build the release unless it is there whole; returns its name."""
        name = release_name(source)
        folder = self.releases / name
        if not (folder / ".complete").is_file():
            shutil.rmtree(folder, ignore_errors=True)
            self.releases.mkdir(parents=True, exist_ok=True)
            build(source, folder)
            for kept in ("manage.py", "README.md"):
                shutil.copyfile(source / "deploy" / kept, folder / kept)
            sync_tree(folder)
            write_whole(folder / ".complete", b"")
        return name

    def switch(self, name: str) -> None:
        """Put a release on trial. The order matters: first the way back, then the new one."""
        running = self.release(self.current)
        if running and self.on_trial() is None:
            point(self.previous, f"releases/{running}")
        write_whole(self.trial, json.dumps({"release": name, "starts": 0}).encode())
        point(self.current, f"releases/{name}")
        self.note(f"{name} is on trial; {self.release(self.previous) or 'nothing'} is the way back")
        self.forget_others()

    def place_files(self, source: Path) -> None:
        """Units, rules and settings; the configuration of the robot is never overwritten."""
        for origin, place in PLACED.items():
            data = (source / origin).read_bytes()
            target = self.root / place
            if not target.is_file() or target.read_bytes() != data:
                write_whole(target, data)
        settings = self.root / "etc/sweeper/robot.toml"
        if not settings.exists():
            write_whole(settings, (source / "deploy/config/robot.toml").read_bytes())
        boot_config = self.root / "boot/firmware/config.txt"
        if boot_config.is_file():
            old = boot_config.read_text(encoding="utf-8")
            new = with_block(old)
            if new != old:
                write_whole(boot_config, new.encode(), 0o755)

    def take_boot_tool(self, source: Path) -> None:
        """The copy that counts starts and rolls back."""
        tool = source / "manage.py"
        tool = tool if tool.is_file() else source / "deploy/manage.py"
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

    # ------------------------------------------------------------ the trial

    def count(self) -> None:
        """The service is about to start: after three starts without a good minute, go back."""
        if not self.release(self.current) and self.release(self.previous):
            self.go_back("the current release is damaged")
            return
        starts = self.on_trial()
        if starts is None:
            return
        if starts >= STARTS_ON_TRIAL:
            self.go_back(f"{starts} starts without a good minute")
            return
        noted = {"release": self.release(self.current), "starts": starts + 1}
        write_whole(self.trial, json.dumps(noted).encode())

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
        self.take_boot_tool(self.releases / name)
        self.trial.unlink(missing_ok=True)
        sync_folder(self.home)
        self.note(f"{name} is good")

    # ------------------------------------------------------------ away

    def uninstall(self, purge: bool) -> None:
        """Remove what was installed; settings and maps stay unless `purge`."""
        for place in PLACED.values():
            (self.root / place).unlink(missing_ok=True)
        boot_config = self.root / "boot/firmware/config.txt"
        if boot_config.is_file():
            old = boot_config.read_text(encoding="utf-8")
            write_whole(boot_config, without_block(old).encode(), 0o755)
        shutil.rmtree(self.home, ignore_errors=True)
        if purge:
            for name in ("etc/sweeper", "var/lib/sweeper", "var/lib/private/sweeper"):
                path = self.root / name
                path.unlink() if path.is_symlink() else shutil.rmtree(path, ignore_errors=True)


# ---------------------------------------------------------------- parts


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


def without_block(text: str) -> str:
    """config.txt without our lines."""
    kept, inside = [], False
    for line in text.splitlines():
        inside = inside or line.strip() == BEGIN
        if not inside:
            kept.append(line)
        inside = inside and line.strip() != END
    return "\n".join(kept).rstrip("\n") + "\n"


def with_block(text: str) -> str:
    """config.txt with our lines, once, valid for every board ([all])."""
    return f"{without_block(text)}{BEGIN}\n[all]\n{CONFIG_TXT}{END}\n"


def systemctl(*arguments: str) -> None:
    """Only on a real system."""
    subprocess.run(["systemctl", *arguments], check=False)


def after_change(verb: str) -> None:
    """What a running system must be told."""
    if verb == "uninstall":
        systemctl("daemon-reload")
        return
    subprocess.run(["systemd-sysusers"], check=False)
    subprocess.run(["udevadm", "control", "--reload"], check=False)
    subprocess.run(["udevadm", "trigger"], check=False)
    systemctl("daemon-reload")
    systemctl("enable", *ENABLED)
    systemctl("restart", "systemd-journald.service")
    systemctl("reset-failed", "sweeper.service")
    systemctl("restart", "sweeper.service", "sweeper-serve.service", "sweeper-tidy.timer")


def main(arguments: list[str] | None = None, build: Build = build_venv) -> int:
    """Exit code 2 with one sentence when something is wrong."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    verbs = ("install", "update", "count", "good", "rollback", "status", "uninstall")
    parser.add_argument("verb", choices=verbs)
    parser.add_argument("source", nargs="?", type=Path, help="a checkout (install, update)")
    parser.add_argument("--root", type=Path, default=Path("/"))
    parser.add_argument("--purge", action="store_true", help="uninstall: settings and maps, too")
    given = parser.parse_args(arguments)
    home = Home(given.root)
    real = given.root == Path("/")
    try:
        if real and given.verb != "status" and os.geteuid() != 0:
            raise Refused("this needs root; put sudo before it, or give --root DIR.")
        if given.verb in ("install", "update"):
            if given.source is None:
                raise Refused(f"{given.verb} needs the path of a checkout.")
            getattr(home, given.verb)(given.source.resolve(), build)
        elif given.verb == "uninstall":
            if real:
                systemctl("disable", "--now", *ENABLED)
            home.uninstall(given.purge)
        elif given.verb == "rollback":
            home.go_back("asked for")
        elif given.verb == "status":
            trial = home.on_trial()
            print(json.dumps({
                "current": home.release(home.current), "previous": home.release(home.previous),
                "trial_starts": trial,
            }))  # fmt: skip
        else:
            getattr(home, given.verb)()
        if real and given.verb in ("install", "update", "rollback", "uninstall"):
            after_change(given.verb)
    except (Refused, OSError) as error:
        print(f"manage.py: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
