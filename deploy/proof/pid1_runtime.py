"""Stands for `sweeper` in the trial of the service: the real live body without its devices.

`run` lives until it is killed, and hangs when the file `hang` appears in its runtime folder;
`wheels stop` notes when it was called. A release whose `broken` file exists fails at once.
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import numpy as np

from robot.body.live import LiveBody
from robot.body.notify import Notifier
from robot.config import Config
from robot.hardware.fakes import FakeStereo
from robot.messages import DriveCommand, Scan, Seen, StopOrder, Tick, WheelTravel
from robot.run import run

SCAN = Scan(np.zeros(1), np.full(1, np.nan), np.zeros(1))


class Eyes:
    """Sees nothing, quickly."""

    def see(self, frame, arrived_ns):
        return Seen(frame.t_ns, arrived_ns, frame.seq, (), SCAN, 1.0)


class Wheels:
    """Notes orders in the runtime folder; a controller would expire them after 200 ms."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def poll(self, now_ns):
        while (self._folder / "hang").exists():
            time.sleep(0.1)
        return [WheelTravel(now_ns, now_ns, 0.0, 0.0)]

    def send(self, command):
        if isinstance(command, StopOrder):
            note(self._folder, "stopped")


class Brain:
    """Drives on every tick."""

    def on(self, event):
        return (
            [DriveCommand(event.t_ns, 0.1, 0, 0, 0, 200, "trial")]
            if isinstance(event, Tick)
            else []
        )


class Log:
    """Nothing is kept."""

    def event(self, event): ...

    def command(self, command): ...

    def flush(self): ...


def note(folder: Path, what: str) -> None:
    """When something happened, in the file of that name."""
    (folder / what).write_text(f"{time.monotonic()}")


def main() -> None:
    release = Path(sys.argv[1])
    folder = Path(os.environ.get("RUNTIME_DIRECTORY", "/run/sweeper"))
    if "stop" in sys.argv:
        if folder.is_dir():
            note(folder, "stopped")
        return
    if "check" in sys.argv:
        return
    if (release / "broken").exists():
        raise SystemExit(1)
    body = LiveBody(
        Config(), FakeStereo([]), Eyes(), Wheels(folder), notifier=Notifier(), start=False
    )
    note(folder, "begun")
    run(body, Brain(), Log())


if __name__ == "__main__":
    main()
