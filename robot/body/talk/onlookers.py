"""People who watch and steer a run over its socket: what the body and the log need for them.

Without a socket nothing of this exists, and a run is as it always was.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Protocol

from robot.body.base import Asked, EventLog, Recorder
from robot.body.calibration.wizard import EXACT, CalibrationDesk
from robot.body.checks.check import check_running
from robot.body.kept.books import Books, WithSchedule
from robot.body.records.diary import Diary
from robot.body.records.observe import Observer
from robot.body.talk.control import ControlSocket
from robot.body.talk.outlook import Outlook, Sight
from robot.body.talk.publisher import Looked, Publisher
from robot.config import Config


class Looking(Protocol):
    """Perception, as far as people look through it."""

    looked: Looked | None


class Onlookers:
    """The socket of a run, and what stands behind it."""

    def __init__(self, socket: Path | None, config: Config, body: str, stack: ExitStack) -> None:
        """Raises HardwareError when the socket cannot be opened."""
        self._config, self._body, self._stack = config, body, stack
        self._exact = EXACT if body == "sim" else ""
        self._looking: Looking | None = None
        self._outlook: Outlook | None = None
        self._desk: CalibrationDesk | None = None
        self.control: ControlSocket | None = None
        self.asked: Asked | None = None  # the socket, and perhaps a schedule beside it
        if socket is not None:
            self.asked = self.control = ControlSocket(socket, judged=True)
            stack.callback(self.control.close)

    def keep_books(self, log: EventLog, folder: Path) -> Books:
        """The schedule asks, too, and the books can be looked up. Raises ConfigError."""
        books = Books(log, folder)
        self._stack.callback(books.close)
        desk = self._desk = CalibrationDesk(folder, books.resting, self._exact)
        self._stack.callback(desk.close)
        self.asked = WithSchedule(self.control, books, desk.verbs())
        if self._outlook is not None:
            self._outlook.offer("mission", "map", "books")
        return books

    def recorder(self, recorder: Recorder | None) -> Recorder | None:
        """What the body gives its pictures to: who calibrates looks at them, too."""
        return recorder if self._desk is None else self._desk.stand_before(recorder)

    def look_through(self, perception: Looking) -> None:
        """From now on, this is what the robot sees."""
        self._looking = perception

    def stand_before(
        self, observer: Observer, brain: Sight, folder: Callable[[str], Path]
    ) -> EventLog:
        """The log that the loop writes to; `folder` makes the folder of a finished run."""
        if self.control is None:
            return observer
        config = self._config
        diary = Diary(observer, folder)
        outlook = self._outlook = Outlook(diary, brain, self._body, config.robot.radius_m)
        outlook.offer("mission", "map")  # until somebody keeps books
        publisher = Publisher(outlook, self._looked, lambda: check_running(config, self._exact))
        self._stack.callback(publisher.stop)
        self.control.adopt = publisher.adopt
        publisher.start()
        return outlook

    def _looked(self) -> Looked | None:
        return None if self._looking is None else self._looking.looked
