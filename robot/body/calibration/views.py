"""Collects views of a calibration board: from a folder, or live while a person moves the board."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np

from robot.body.sources import open_stereo
from robot.calibrate.board import Board, Found
from robot.calibrate.coverage import Coverage
from robot.calibrate.stereo import View
from robot.config import Config
from robot.errors import CalibrationError
from robot.hardware.frames_folder import list_pairs, read_pair
from robot.messages import StereoFrame

STILL_SHARE = 0.003  # of the width: a board that moves more between two frames is blurred
NEW_SHARE = 0.06  # and one that stands nearer to an earlier view says nothing new


@dataclass
class Collected:
    """Views with the board in both eyes, and where in the left image it has been."""

    size_px: tuple[int, int]
    coverage: Coverage
    views: list[View] = field(default_factory=list)

    def add(self, view: View) -> None:
        """Take a view."""
        self.views.append(view)
        self.coverage.add(view.left)


def collect_folder(folder: Path, board: Board) -> Collected:
    """All pairs of a folder in which both eyes see the board. Raises FrameError."""
    collected: Collected | None = None
    for left_path, right_path in list_pairs(folder):
        left, right = read_pair(left_path, right_path)
        size_px = (left.shape[1], left.shape[0])
        if collected is None:
            collected = Collected(size_px, Coverage(size_px))
        if size_px != collected.size_px:
            raise CalibrationError(f"{left_path}: another size than the others; remove it.")
        found = (board.find(left), board.find(right))
        if found[0] is not None and found[1] is not None:
            collected.add(View(left_path.name, found[0], found[1]))
    assert collected is not None  # list_pairs refuses an empty folder
    return collected


class Chooser:
    """Takes a view when the board stands still and where it has not been; `said`: why not."""

    def __init__(self, board: Board, width_px: int) -> None:
        self._board, self._width = board, width_px
        self._before: Found | None = None
        self._taken: list[Found] = []
        self.said = ""

    def consider(self, frame: StereoFrame) -> View | None:
        """The view in this frame, if it is worth keeping."""
        left = self._board.find(frame.left)
        before, self._before = self._before, left
        self.said = self._why_not(before, left)
        right = None if self.said or left is None else self._board.find(frame.right)
        if left is None or right is None:
            self.said = self.said or "only the left eye sees the board"
            return None
        self._taken.append(left)
        self.said = "taken"
        return View(f"{frame.seq}", left, right)

    def _why_not(self, before: Found | None, left: Found | None) -> str:
        if left is None:
            return "no board in sight"
        if before is None or _moved(before, left) > STILL_SHARE * self._width:
            return "hold the board still"
        if any(_moved(taken, left) < NEW_SHARE * self._width for taken in self._taken):
            return "this view is taken; move or tilt the board"
        return ""


def _moved(one: Found, other: Found) -> float:
    """Mean way of the corners that both show, in pixels; infinite when they share too few."""
    _, a, b = np.intersect1d(one.ids, other.ids, return_indices=True)
    if len(a) < 4:
        return float("inf")
    return float(np.linalg.norm(one.pixel[a] - other.pixel[b], axis=1).mean())


def collect_live(
    config: Config,
    board: Board,
    size_px: tuple[int, int],
    wanted: int,
    seconds: float,
    keep: Path | None,
) -> Collected:
    """Watch the cameras until `wanted` views cover the image, or the time is over."""
    collected = Collected(size_px, Coverage(size_px))
    chooser = Chooser(board, size_px[0])
    camera = open_stereo(config, size_px)
    end_s = time.monotonic() + seconds
    try:
        while time.monotonic() < end_s:
            frame = camera.read()
            view = chooser.consider(frame) if frame is not None else None
            if view is None or frame is None:
                continue
            collected.add(view)
            advice = collected.coverage.advice()
            print(f"{len(collected.views)} of {wanted}: {advice or 'well covered'}", flush=True)
            if keep is not None:
                _keep(keep, len(collected.views), frame)
            if len(collected.views) >= wanted and not advice:
                break
    finally:
        camera.close()
    return collected


def _keep(folder: Path, number: int, frame: StereoFrame) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for side, image in (("left", frame.left), ("right", frame.right)):
        if not cv2.imwrite(str(folder / f"{side}{number:02d}.png"), image):
            raise CalibrationError(f"--keep {folder}: cannot be written; give a writable folder.")
