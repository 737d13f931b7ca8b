"""`make service`: the real units under a real systemd as PID 1, killed, hung, broken, rolled back.

In namespaces of its own (root, overlayfs, cgroup 2; nothing outside changes): `pid1_machine.py`.
What is measured: how soon the wheels are stopped after kill -9 and the service is ready again, that
no file is damaged by a kill amid writing (`--kills`), how soon a hang is caught, that a broken
update is rolled back, and that a service that fails again and again ends in safe mode.
Exit code 3 says that one of these is wrong; any other but 0, that this machine cannot show it.
"""

from __future__ import annotations

import argparse
import functools
import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

sys.path[:0] = [str(Path(__file__).resolve().parents[k]) for k in (0, 1)]
import manage  # noqa: E402
from pid1_machine import boot, build, checkout  # noqa: E402
from slots import Slots  # noqa: E402

KEPT = "var/lib/private/sweeper/trial"  # of the service's state, below its root
STATE = (
    "ActiveState",
    "SubState",
    "Result",
    "MainPID",
    "NRestarts",
    "StatusText",
    "ExecMainStatus",
)


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


def trials(root: Path, kills: int) -> dict[str, object]:
    """All of them, one after the other."""
    service = Service(root)
    result: dict[str, object] = {}
    result["ready_s"] = service.until(service.ready, 60.0, "first start")
    result["status"] = ""
    service.until(lambda: bool(service.show("StatusText")), 5.0, "a status")
    result["status"] = service.show("StatusText")
    result["kill_9"] = [interrupted(service, kill) for _ in range(3)]
    result["killed_while_writing"] = killed_while_writing(service, kills)
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


def killed_while_writing(service: Service, kills: int) -> dict[str, int]:
    """Kill -9 amid writing; every file is whole then, and none older than before."""
    from kills import Card, compare

    service.until(lambda: Slots(service.root).on_trial() is None, 40.0, "a good minute (here 3 s)")
    wait, write = random.Random(kills), service.folder / "write"
    card, amid = Card(service.root / KEPT), 0
    before: dict[str, int] = {}
    for _ in range(kills):
        start_s = time.monotonic()
        write.touch()  # who has been started since begins to write
        service.until(lambda s=start_s: service.noted_s("written") > s, 60.0, "written")
        systemctl(service, "reset-failed", "sweeper.service")  # so many starts are no fault here
        time.sleep(wait.uniform(0.0, 0.4))
        write.unlink()
        kill(service)
        now = card.check()
        compare(before, now)
        amid += len(set(now.values())) > 1
        before = now
    return {"kills": kills, "whole": kills, "amid_a_round": amid}


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
    parser.add_argument("--kills", type=int, default=5, help="kill -9 so often amid writing")
    parser.add_argument("--inside", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    work = given.work.resolve() / "pid1"
    if given.inside:
        boot(work, functools.partial(trials, kills=given.kills))
        return
    work.mkdir(parents=True, exist_ok=True)
    answer = work.parent / "pid1.json"
    answer.unlink(missing_ok=True)
    console = work.parent / "pid1.console"
    subprocess.run(
        ["unshare", "--kill-child", "--mount", "--pid", "--fork", "--uts", "--ipc", "--cgroup",
         "--propagation", "private", sys.executable, __file__, "--work", str(given.work),
         "--kills", str(given.kills), "--inside"],
        stdin=subprocess.DEVNULL, check=False, timeout=280 + 30 * given.kills,
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
