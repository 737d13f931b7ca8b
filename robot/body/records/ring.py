"""A log that never ends and never grows: segments in RAM, the oldest of which give way.

Each segment is a whole log of its own. The card sees nothing of it until something goes wrong:
then the newest segments are copied there (`rescue`).
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from robot.body.base import EventLog, Recorder
from robot.config import LogConfig
from robot.geometry.se2 import SE2
from robot.log.header import LogHeader
from robot.log.writer import LogWriter
from robot.messages import Command, Event, StereoFrame, Tick

SEGMENT_BYTES = 6_000_000
SEGMENTS = 8  # at most 48 MB of RAM
RESCUED = 3
CLEAN = "ended-in-order"
CHECK_EVERY = 500  # ticks between two looks at the size: ten seconds


class LogRing(EventLog, Recorder):
    """Writes `log-<number>.mcap` in `folder`; a new one whenever the present one is full."""

    def __init__(
        self,
        folder: Path,
        header: LogHeader,
        config: LogConfig | None = None,
        *,
        segment_bytes: int = SEGMENT_BYTES,
        segments: int = SEGMENTS,
        make: Callable[[Path, LogHeader, LogConfig | None], LogWriter] = LogWriter,
    ) -> None:
        """Raises LogError when the folder cannot be written."""
        self._folder, self._header, self._config = folder, header, config
        self._segment_bytes, self._segments, self._make = segment_bytes, segments, make
        folder.mkdir(parents=True, exist_ok=True)
        (folder / CLEAN).unlink(missing_ok=True)
        self._number = max([_number(p) for p in self.files()], default=0)
        self._ticks = 0
        self._writer = self._next()

    def files(self) -> list[Path]:
        """The segments that are there, oldest first."""
        return sorted(self._folder.glob("log-*.mcap"), key=_number)

    def event(self, event: Event) -> None:
        """Write; between two ticks a full segment gives way to the next one."""
        if isinstance(event, Tick):
            self._ticks += 1
            if self._ticks % CHECK_EVERY == 0 and self._full():
                self._writer.close()
                self._writer = self._next()
        self._writer.event(event)

    def command(self, command: Command) -> None:
        """Write."""
        self._writer.command(command)

    def flush(self) -> None:
        """Bring what is buffered into the file."""
        self._writer.flush()

    def frame(self, frame: StereoFrame) -> None:
        """Write."""
        self._writer.frame(frame)

    def truth(self, t_ns: int, world_from_base: SE2) -> None:
        """Write."""
        self._writer.truth(t_ns, world_from_base)

    def close(self) -> None:
        """Give the present segment its index, and note that the end was orderly."""
        self._writer.close()
        (self._folder / CLEAN).touch()

    def __enter__(self) -> LogRing:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def rescue(self, target: Path) -> list[Path]:
        """Copy the newest segments to the card: the minutes around a fault."""
        self.flush()
        target.mkdir(parents=True, exist_ok=True)
        return [Path(shutil.copy(path, target)) for path in self.files()[-RESCUED:]]

    def _full(self) -> bool:
        try:
            return os.path.getsize(self._path) >= self._segment_bytes
        except OSError:
            return True

    def _next(self) -> LogWriter:
        self._number += 1
        self._path = self._folder / f"log-{self._number:06d}.mcap"
        old = self.files()
        for path in old[: max(0, len(old) - self._segments + 1)]:
            path.unlink(missing_ok=True)
        return self._make(self._path, replace(self._header), self._config)


LogFile = LogWriter | LogRing


def open_log(ring: Path | None, folder: Path, header: LogHeader, config: LogConfig) -> LogFile:
    """A ring where one is asked for, else one file in the run's folder.

    What a life that ended without a word has left in the ring is brought to the run's folder.
    """
    if ring is None:
        return LogWriter(folder / "log.mcap", header, config)
    for path in left_behind(ring):
        shutil.copy(path, folder / f"before-{path.name}")
    return LogRing(ring, header, config)


def left_behind(ring: Path) -> list[Path]:
    """The newest segments of a life that was killed; none after an orderly end."""
    if (ring / CLEAN).exists():
        return []
    return sorted(ring.glob("log-*.mcap"), key=_number)[-RESCUED:]


@contextmanager
def rescued(log: LogFile, folder: Path) -> Iterator[None]:
    """When the loop ends with an error, the minutes before it go to the card."""
    try:
        yield
    except BaseException:
        if isinstance(log, LogRing):
            log.rescue(folder)
        raise


def _number(path: Path) -> int:
    digits = path.stem.rpartition("-")[2]
    return int(digits) if digits.isdigit() else 0
