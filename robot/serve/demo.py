"""`make demo`: the simulator in real time, with the page in front of it.

The runtime is a process of its own, as on a robot; this one only serves.
"""

from __future__ import annotations

import argparse
import contextlib
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from robot.errors import SweeperError
from robot.serve.main import ServeOptions, serve

STARTUP_S = 300.0  # the first start compiles the simulator and the firmware


def main() -> int:
    """Run until interrupted."""
    parser = argparse.ArgumentParser(prog="make demo", description=__doc__)
    parser.add_argument("--scene", default="flat")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--port", type=int, default=8321)
    parser.add_argument("--out", type=Path, default=Path("runs/demo"))
    parser.add_argument("--drawn", action="store_true", help="no pictures: for slow machines")
    parser.add_argument("--idle", action="store_true", help="wait for the page's start button")
    options = parser.parse_args()
    try:
        demo(options)
    except SweeperError as error:
        print(f"sweeper: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("\nThe demo is over.")
    return 0


def demo(options: argparse.Namespace) -> None:
    """Start the simulator, wait for its socket, serve. Raises SweeperError."""
    with tempfile.TemporaryDirectory(prefix="sweeper-demo-") as folder:
        socket = Path(folder) / "control.sock"
        robot = subprocess.Popen(run_command(options, socket))
        try:
            print("Building the home and waking the robot ...", flush=True)
            wait_for(socket, robot)
            if not options.idle:
                start(socket, robot)
            settings = ServeOptions(
                socket=socket, runs=options.out, state=options.out, port=options.port
            )
            serve(settings, lambda address: print(f"Open {address}", flush=True))
        finally:
            robot.terminate()
            with contextlib.suppress(subprocess.TimeoutExpired):
                robot.wait(timeout=10)
            robot.kill()


def run_command(options: argparse.Namespace, socket: Path) -> list[str]:
    """The runtime's command line."""
    words = [
        *("--body", "sim", "--real-time", "--wait", "--no-progress"),
        *("--scene", options.scene, "--seed", str(options.seed)),
        *("--socket", str(socket), "--out", str(options.out)),
        *("--home", str(options.out / f"home-{Path(options.scene).stem}-{options.seed}")),
    ]
    return [sys.executable, "-m", "robot", "run", *words, *(["--drawn"] if options.drawn else [])]


def wait_for(socket: Path, robot: subprocess.Popen[bytes]) -> None:
    """Raises SweeperError if the robot dies, or does not wake in time."""
    end_s = time.monotonic() + STARTUP_S
    while not socket.exists():
        _check_alive(robot)
        if time.monotonic() > end_s:
            raise SweeperError(f"the simulator did not wake within {STARTUP_S:.0f} s; try again.")
        time.sleep(0.1)


def start(socket: Path, robot: subprocess.Popen[bytes]) -> None:
    """Ask until the robot's loop has begun and answers. Raises SweeperError if it dies."""
    ask = [sys.executable, "-m", "robot", "ask", "start", "--socket", str(socket)]
    while subprocess.run(ask, check=False, capture_output=True).returncode != 0:
        _check_alive(robot)


def _check_alive(robot: subprocess.Popen[bytes]) -> None:
    if robot.poll() is not None:
        raise SweeperError("the simulator ended before it began; its own words are above.")


if __name__ == "__main__":
    sys.exit(main())
