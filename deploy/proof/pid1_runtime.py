"""Stands for `sweeper` in the trial of the service: the real live body without its devices.

`run` lives until it is killed. It hangs when the file `hang` appears in its runtime folder, and
writes all that a robot keeps, without a pause, when `write` does. `wheels stop` notes when it was
called. A release whose `broken` file exists fails at once.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from pathlib import Path

import numpy as np

from robot.messages import DriveCommand, Scan, Seen, StopOrder, Tick, WheelTravel

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


def write(folder: Path) -> None:
    """Once `write` is there: the rounds of `kills.py`, from the one after the newest on."""
    while not (folder / "write").exists():
        time.sleep(0.02)
    from kills import Card, write_until_killed

    kept = Path(os.environ["STATE_DIRECTORY"]) / "trial"
    card = Card(kept)
    first = max(card.check().values()) + 1 if kept.exists() else 1
    write_until_killed(card, first, lambda: note(folder, "written"))


def live(folder: Path) -> None:
    """The loop, with nothing behind it."""
    from robot.body.live import LiveBody
    from robot.body.notify import Notifier
    from robot.config import Config
    from robot.hardware.fakes import FakeStereo
    from robot.run import run

    body = LiveBody(
        Config(), FakeStereo([]), Eyes(), Wheels(folder), notifier=Notifier(), start=False
    )
    note(folder, "begun")
    threading.Thread(target=write, args=(folder,), daemon=True).start()
    run(body, Brain(), Log())


def main() -> None:
    release = Path(sys.argv[1])
    folder = Path(os.environ.get("RUNTIME_DIRECTORY", "/run/sweeper"))
    if "stop" in sys.argv:
        if folder.is_dir():
            note(folder, "stopped")
    elif "check" not in sys.argv:
        if (release / "broken").exists():
            raise SystemExit(1)
        live(folder)


if __name__ == "__main__":
    main()
