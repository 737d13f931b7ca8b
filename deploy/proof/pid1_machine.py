"""A machine for the trial of the service: namespaces, a root to be thrown away, and systemd in it.

The machine's own root lies under an overlay; `manage.py` installs a release there whose program is
the stand-in `pid1_runtime.py`. Nothing outside changes.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

HERE = Path(__file__).resolve().parent
REPOSITORY = HERE.parents[1]
sys.path.insert(0, str(HERE.parent))
import manage  # noqa: E402

TARGET = "trial.target"
UNITS = "/run/systemd/system"


def build(origin: Path, folder: Path) -> None:
    """A release whose program is the stand-in, on the system's Python."""
    (folder / "bin").mkdir(parents=True)
    site = next((REPOSITORY / ".venv/lib").glob("python3.*/site-packages"))
    program = folder / "bin/sweeper"
    program.write_text(
        f"#!/bin/sh\nPYTHONPATH={site}:{REPOSITORY} PYTHONDONTWRITEBYTECODE=1 "
        f'exec /usr/bin/python3 {HERE}/pid1_runtime.py /opt/sweeper/releases/{folder.name} "$@"\n'
    )
    program.chmod(0o755)
    if (origin / "broken").exists():
        (folder / "broken").touch()


def checkout(folder: Path, version: str, broken: bool = False) -> Path:
    """As much of a checkout as is installed."""
    for part in ("deploy", "systemd"):
        shutil.copytree(REPOSITORY / part, folder / part, dirs_exist_ok=True)
    (folder / "pyproject.toml").write_text(f'version = "{version}"\n')
    (folder / "robot").mkdir(exist_ok=True)
    if broken:
        (folder / "broken").touch()
    return folder


def lay_out(work: Path) -> Path:
    """The machine's own root under a layer that is thrown away; /run, /tmp, /dev of its own."""

    def mount(*words: str) -> None:
        subprocess.run(["mount", *words], check=True)

    mount("-t", "tmpfs", "tmpfs", str(work))
    for name in ("upper", "inner", "root"):
        (work / name).mkdir()
    root = work / "root"
    layers = f"lowerdir=/,upperdir={work}/upper,workdir={work}/inner"
    mount("-t", "overlay", "overlay", "-o", layers, str(root))
    mount("-t", "proc", "proc", str(root / "proc"))
    for name in ("run", "tmp"):
        mount("-t", "tmpfs", "tmpfs", str(root / name))
    mount("-t", "tmpfs", "-o", "mode=755", "tmpfs", str(root / "dev"))
    for name in ("null", "zero", "full", "random", "urandom", "tty"):
        (root / "dev" / name).touch()
        mount("--bind", f"/dev/{name}", str(root / "dev" / name))
    for name in ("shm", "pts"):
        (root / "dev" / name).mkdir()
    mount("-t", "devpts", "-o", "newinstance,ptmxmode=0666", "devpts", str(root / "dev/pts"))
    (root / "dev/ptmx").symlink_to("pts/ptmx")
    mount("-t", "sysfs", "-o", "ro", "sysfs", str(root / "sys"))
    mount("-t", "cgroup2", "cgroup2", str(root / "sys/fs/cgroup"))
    return root


def furnish(root: Path) -> None:
    """Install, and a target that pulls in nothing but the robot's units."""
    origin = checkout(root / "tmp/one", "0.1.0")
    assert manage.main(["install", str(origin), "--root", str(root)], build) == 0
    (root / "etc/sysusers.d").mkdir(exist_ok=True)
    subprocess.run(["systemd-sysusers", f"--root={root}"], check=True, capture_output=True)
    units = root / UNITS.lstrip("/")
    units.mkdir(parents=True)
    for unit in (root / "etc/systemd/system").glob("sweeper*.service"):
        text = unit.read_text().replace("[Unit]", "[Unit]\nDefaultDependencies=no", 1)
        text = text.replace("/bin/sleep 60", "/bin/sleep 3")  # a minute, for the trial
        (units / unit.name).write_text(text)
        unit.unlink()
    (units / TARGET).write_text(
        "[Unit]\nDefaultDependencies=no\nRequires=sweeper.service sweeper-good.service\n"
    )
    wants = units / "sweeper.service.wants"
    wants.mkdir()
    (wants / "sweeper-good.service").symlink_to(f"{UNITS}/sweeper-good.service")


def listen(root: Path, target: Path) -> None:
    """A console for systemd, kept in a file by a process of its own."""
    mine, theirs = os.openpty()
    (root / "dev/console").touch()
    subprocess.run(["mount", "--bind", os.ttyname(theirs), str(root / "dev/console")], check=True)
    if os.fork() == 0:
        with open(target, "wb", buffering=0) as file:
            while True:
                try:
                    file.write(os.read(mine, 4096))
                except OSError:
                    os._exit(0)


def boot(work: Path, trials: Callable[[Path], dict[str, object]]) -> None:
    """Becomes systemd; `trials` go on beside it, and what they find is in `pid1.json`."""
    root = lay_out(work)
    furnish(root)
    listen(root, work.parent / "pid1.console")
    if os.fork() == 0:
        try:
            code = 0
            result = trials(root)
            (work.parent / "pid1.json").write_text(json.dumps(result, indent=2))
        except BaseException as error:
            (work.parent / "pid1.json").write_text(
                json.dumps({"failed": repr(error), "wrong": isinstance(error, AssertionError)})
            )
            code = 1
        finally:
            os.kill(1, signal.SIGRTMIN + 14)  # systemd: power off now
        os._exit(code)
    os.chroot(root)
    os.chdir("/")
    environment = {"PATH": "/usr/sbin:/usr/bin:/sbin:/bin", "container": "trial",
                   "SYSTEMD_UNIT_PATH": f"{UNITS}:"}  # fmt: skip
    words = ["--log-target=console", "--log-level=info", "--show-status=no"]
    program = "/lib/systemd/systemd"
    os.execve(program, ["systemd", "--system", f"--unit={TARGET}", *words], environment)
