"""`make service`: the real units under a real systemd as PID 1, killed, hung, broken, rolled back.

In namespaces of its own (root, overlayfs, cgroup 2; nothing outside changes) `manage.py` installs a
release whose program is `pid1_runtime.py`, then systemd boots into it. What is measured: how soon
the wheels are stopped after kill -9 and the service is ready again, how soon a hang is caught, that
a broken update is rolled back, and that a service that fails again and again ends in safe mode.
Exit code 3 says that one of these is wrong; any other but 0, that this machine cannot show it.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

HERE = Path(__file__).resolve().parent
REPOSITORY = HERE.parents[1]
sys.path.insert(0, str(HERE.parent))
import manage  # noqa: E402
from slots import Slots  # noqa: E402

TARGET = "trial.target"
UNITS = "/run/systemd/system"
STATE = (
    "ActiveState",
    "SubState",
    "Result",
    "MainPID",
    "NRestarts",
    "StatusText",
    "ExecMainStatus",
)


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


# ---------------------------------------------------------------- inside the namespaces


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


def boot(work: Path) -> None:
    """Becomes systemd; the trials go on beside it."""
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


# ---------------------------------------------------------------- the trials


class Service:
    """The service as seen from beside systemd."""

    def __init__(self, root: Path) -> None:
        self.root, self.folder = root, root / "run/sweeper"

    def show(self, what: str, unit: str = "sweeper.service") -> str:
        done = subprocess.run(
            ["chroot", str(self.root), "systemctl", "show", unit, "-p", what, "--value"],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        return done.stdout.strip()

    def until(self, truth: Callable[[], bool], seconds: float, what: str) -> float:
        """Seconds until it is true. Raises TimeoutError."""
        start_s = time.monotonic()
        while time.monotonic() - start_s < seconds:
            if truth():
                return time.monotonic() - start_s
            time.sleep(0.02)
        state = " ".join(f"{key}={self.show(key)}" for key in STATE)
        raise TimeoutError(f"{what}: not within {seconds:.0f} s; {state}")

    def ready(self) -> bool:
        return self.show("ActiveState") == "active"

    def main_pid(self) -> int:
        return int(self.show("MainPID") or 0)

    def noted_s(self, what: str) -> float:
        try:
            return float((self.folder / what).read_text())
        except (OSError, ValueError):
            return 0.0

    def release(self) -> str:
        return Path(os.readlink(self.root / "opt/sweeper/current")).name[:5]


def trials(root: Path) -> dict[str, object]:
    """All of them, one after the other."""
    service = Service(root)
    result: dict[str, object] = {}
    result["ready_s"] = service.until(service.ready, 60.0, "first start")
    result["status"] = ""
    service.until(lambda: bool(service.show("StatusText")), 5.0, "a status")
    result["status"] = service.show("StatusText")
    result["kill_9"] = [interrupted(service, kill) for _ in range(3)]
    result["hang"] = [interrupted(service, hang)]
    rolled_back(service, result)
    result["safe_mode"] = ends_in_safe_mode(service)
    return result


def kill(service: Service) -> None:
    os.kill(service.main_pid(), signal.SIGKILL)


def hang(service: Service) -> None:
    (service.folder / "hang").touch()


def interrupted(service: Service, how: Callable[[Service], None]) -> dict[str, float]:
    """Seconds until the stop was said, and until it is ready again."""
    service.until(lambda: service.noted_s("begun") > 0.0 and service.ready(), 30.0, "running")
    pid, start_s = service.main_pid(), time.monotonic()
    how(service)
    service.until(lambda: service.noted_s("stopped") > start_s, 20.0, "stopped")
    stopped_s = service.noted_s("stopped") - start_s
    (service.folder / "hang").unlink(missing_ok=True)
    service.until(lambda: service.ready() and service.main_pid() not in (0, pid), 40.0, "ready")
    return {"stopped_s": round(stopped_s, 2), "ready_s": round(time.monotonic() - start_s, 2)}


def rolled_back(service: Service, result: dict[str, object]) -> None:
    """A good update stays; a broken one is gone after three starts."""
    home = Slots(service.root)
    systemctl(service, "reset-failed", "sweeper.service")
    update(service, "0.2.0")
    result["good_s"] = round(
        service.until(lambda: home.on_trial() is None, 40.0, "a good minute (here 3 s)"), 1
    )
    assert service.release() == "0.2.0"
    systemctl(service, "reset-failed", "sweeper.service")
    update(service, "0.3.0", broken=True)
    result["rollback_s"] = round(
        service.until(lambda: service.release() == "0.2.0" and service.ready(), 60.0, "rollback"), 1
    )


def update(service: Service, version: str, broken: bool = False) -> None:
    origin = checkout(service.root / f"tmp/{version}", version, broken)
    assert manage.main(["update", str(origin), "--root", str(service.root)], build) == 0
    # Units come with an update; the trial's own, without defaults, stay in front of them.
    systemctl(service, "restart", "--no-block", "sweeper.service")


def systemctl(service: Service, *words: str) -> None:
    subprocess.run(["chroot", str(service.root), "systemctl", *words], check=False)


def ends_in_safe_mode(service: Service) -> str:
    """The release that ran well breaks: nothing is left to go back to."""
    systemctl(service, "reset-failed", "sweeper.service")
    for release in (service.root / "opt/sweeper/releases").iterdir():
        (release / "broken").touch()
    kill(service)
    service.until(
        lambda: service.show("ActiveState", "sweeper-safe.service") == "active", 90.0, "safe mode"
    )
    return service.show("ActiveState") + ", " + service.show("Result")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--work", type=Path, default=Path("build/proof"))
    parser.add_argument("--inside", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    work = given.work.resolve() / "pid1"
    if given.inside:
        boot(work)
        return
    work.mkdir(parents=True, exist_ok=True)
    answer = work.parent / "pid1.json"
    answer.unlink(missing_ok=True)
    console = work.parent / "pid1.console"
    subprocess.run(
        ["unshare", "--kill-child", "--mount", "--pid", "--fork", "--uts", "--ipc", "--cgroup",
         "--propagation", "private", sys.executable, __file__, "--work", str(given.work),
         "--inside"],
        stdin=subprocess.DEVNULL, check=False, timeout=280,
    )  # fmt: skip
    if not answer.exists():
        raise SystemExit(f"systemd did not come up; see {console}")
    result = json.loads(answer.read_text())
    print(json.dumps(result, indent=2))
    late = [t for t in result.get("kill_9", []) if t["stopped_s"] > 2.0 or t["ready_s"] > 15.0]
    slow = [t for t in result.get("hang", []) if t["stopped_s"] > 5.0 + 2.0]
    if late or slow or result.get("wrong"):
        raise SystemExit(3)
    if "failed" in result:
        raise SystemExit(f"failed; see {console}")


if __name__ == "__main__":
    main()
