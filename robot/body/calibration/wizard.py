"""The calibration wizard: the running robot looks for a board in its own pictures, while it rests.

A thread of its own takes the newest pair of the cameras, keeps views that tell something new, and
says after each how well the image is covered and how far the eyes' rows are apart. The result is a
file beside the map; the robot uses it once its configuration names that file and it starts anew.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import cv2

from robot.body.base import Recorder
from robot.body.calibration.verbs import DEFAULT_BOARD
from robot.body.calibration.views import Chooser, Collected
from robot.body.kept.store import write_whole
from robot.calibrate.board import Board, parse_board
from robot.calibrate.coverage import Coverage
from robot.calibrate.files import Provenance, write_calibration
from robot.calibrate.stereo import (
    MAX_EPIPOLAR_PX,
    MAX_RMS_PX,
    MIN_VIEWS,
    StereoResult,
    calibrate_stereo,
)
from robot.errors import CalibrationError, RequestError
from robot.geometry.se2 import SE2
from robot.messages import StereoFrame

WANTED_VIEWS = 20
LONGEST_S = 1200.0  # nobody calibrates for longer
EXACT = "the simulator's eyes are exact: there is nothing to calibrate"
Answer = dict[str, Any]


class Sitting(threading.Thread):
    """One calibration: pictures come in by `offer`, what is known so far is in `told`."""

    def __init__(self, board: Board, resting: Callable[[], bool]) -> None:
        super().__init__(name="calibrating", daemon=True)
        self._board, self._resting = board, resting
        self._newest: StereoFrame | None = None
        self._came, self._ended = threading.Event(), threading.Event()
        self._chooser: Chooser | None = None
        self._collected: Collected | None = None
        self.result: StereoResult | None = None
        self.told: Answer = {"views": 0, "seen": "waiting for a picture"}

    def offer(self, frame: StereoFrame) -> None:
        """The newest pair; what nobody had time for is forgotten."""
        self._newest = frame
        self._came.set()

    def end(self) -> None:
        """Look at no further picture."""
        self._ended.set()

    def run(self) -> None:
        """Until it is ended, the robot has something else to do, or it takes too long."""
        end_s = time.monotonic() + LONGEST_S
        while not self._ended.is_set() and self._resting() and time.monotonic() < end_s:
            if self._came.wait(0.2) and self._newest is not None:
                self._came.clear()
                self.look(self._newest)

    def look(self, frame: StereoFrame) -> None:
        """Keep the view if it tells something new, and calibrate with all views so far."""
        size_px = (frame.left.shape[1], frame.left.shape[0])
        if self._chooser is None or self._collected is None:
            self._chooser = Chooser(self._board, size_px[0])
            self._collected = Collected(size_px, Coverage(size_px))
        view = self._chooser.consider(frame)
        problem = self.told.get("problem", "")
        if view is not None:
            self._collected.add(view)
            problem = self._solve(self._collected)
        coverage, result = self._collected.coverage, self.result
        self.told = {
            "views": len(self._collected.views),
            "seen": self._chooser.said,
            "problem": problem,
            "size_px": list(size_px),
            "counts": coverage.counts.tolist(),
            "covered_pct": round(100.0 * coverage.share, 1),
            "advice": coverage.advice(),
            "rms_px": None if result is None else round(result.rms_px, 3),
            "epipolar_px": None if result is None else round(result.epipolar_px, 3),
            "epipolar_unseen_px": None if result is None else round(result.unseen_epipolar_px, 3),
        }

    def _solve(self, collected: Collected) -> str:
        """Returns what is wrong with the views so far; empty while nothing is."""
        if len(collected.views) < MIN_VIEWS:
            return ""
        try:
            self.result = calibrate_stereo(collected.views, self._board, collected.size_px)
        except CalibrationError as error:
            return str(error)
        except cv2.error:
            return "these views cannot be solved; show the board tilted, near and far"
        return ""


class CalibrationDesk:
    """Stands before the recorder, and answers the verbs of calibration (`ControlSocket.books`)."""

    def __init__(self, folder: Path, resting: Callable[[], bool], why_not: str = "") -> None:
        """`folder` takes the result; `why_not` says that there is nothing to calibrate."""
        self._file = folder / "stereo.yaml"
        self._resting, self._why_not = resting, why_not
        self._board, self._saved = DEFAULT_BOARD, ""
        self._sitting: Sitting | None = None
        self._next: Recorder | None = None

    def stand_before(self, recorder: Recorder | None) -> Recorder:
        """What the body gives its pictures to; `recorder` gets them, too."""
        self._next = recorder
        return self

    def frame(self, frame: StereoFrame) -> None:
        """See `Recorder`. Called by the thread that captures."""
        if self._sitting is not None and self._sitting.is_alive():
            self._sitting.offer(frame)
        if self._next is not None:
            self._next.frame(frame)

    def truth(self, t_ns: int, world_from_base: SE2) -> None:
        """See `Recorder`."""
        if self._next is not None:
            self._next.truth(t_ns, world_from_base)

    def close(self) -> None:
        """End the sitting, if there is one."""
        if self._sitting is not None:
            self._sitting.end()

    # ------------------------------------------------------------------ verbs

    def verbs(self) -> dict[str, Callable[[tuple[str, ...]], Answer]]:
        """Each may raise RequestError or CalibrationError."""
        return {
            "calibration show": self._show,
            "calibration begin": self._begin,
            "calibration save": self._save,
            "calibration end": self._end,
        }

    def _show(self, args: tuple[str, ...]) -> Answer:
        sitting = self._sitting
        running = sitting is not None and sitting.is_alive()
        told = {} if sitting is None else sitting.told
        data = {
            "possible": not self._why_not,
            "running": running,
            "board": self._board,
            "wanted": WANTED_VIEWS,
            "max_rms_px": MAX_RMS_PX,
            "max_epipolar_px": MAX_EPIPOLAR_PX,
            "saved": self._saved,
            **told,
        }
        if self._why_not or not running:
            return {"reason": self._why_not or "nobody calibrates now", "data": data}
        return {"reason": f"{told['views']} of {WANTED_VIEWS} views", "data": data}

    def _begin(self, args: tuple[str, ...]) -> Answer:
        if self._why_not:
            raise RequestError(f"{self._why_not}.")
        if not self._resting():
            raise RequestError("the robot is busy; let it rest while the cameras are calibrated.")
        name = args[0] if args else DEFAULT_BOARD
        board = parse_board(name)
        self.close()
        self._board, self._saved = name, ""
        self._sitting = Sitting(board, self._resting)
        self._sitting.start()
        return {"reason": f"hold the board {name} before the cameras"}

    def _save(self, args: tuple[str, ...]) -> Answer:
        result = None if self._sitting is None else self._sitting.result
        if result is None:
            raise RequestError(f"there is no result yet; it takes at least {MIN_VIEWS} views.")
        result.refuse_above(MAX_RMS_PX, MAX_EPIPOLAR_PX)
        date = datetime.now(UTC).isoformat(timespec="seconds")
        provenance = Provenance(date, result.rms_px, result.unseen_epipolar_px)
        (text,) = write_calibration(result.calibration, "opencv", provenance)
        try:
            write_whole(self._file, text.encode())
        except OSError as error:
            raise RequestError(f"{self._file}: cannot be written ({error.strerror}).") from None
        self._saved = str(self._file.absolute())
        return {
            "reason": f'saved; set camera.calibration = "{self._saved}" in the configuration and '
            "start the robot anew",
            "data": {"saved": self._saved},
        }

    def _end(self, args: tuple[str, ...]) -> Answer:
        self.close()
        return {"reason": "ended"}
