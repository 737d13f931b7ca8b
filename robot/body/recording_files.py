"""The files of a recording: images, and tables of numbers."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from robot.errors import CalibrationError, FrameError

_IMAGES = {".png", ".jpg", ".jpeg", ".pgm", ".bmp", ".tif", ".tiff", ".webp"}


def read_grey(path: Path | None) -> np.ndarray | None:
    """A grey uint8 image (h, w), or None if the file is missing or damaged."""
    if path is None:
        return None
    try:
        data = np.fromfile(path, np.uint8)
    except OSError:
        return None
    return cv2.imdecode(data, cv2.IMREAD_GRAYSCALE) if data.size else None


def images_by_stem(folder: Path) -> dict[str, Path]:
    """Image files by their name without extension. Raises FrameError for a missing folder."""
    if not folder.is_dir():
        raise FrameError(f"{folder}: the folder of images is missing; copy it to its place.")
    files = sorted(f for f in folder.iterdir() if f.suffix.lower() in _IMAGES)
    return {file.stem: file for file in files}


def read_text(path: Path, error: type[FrameError | CalibrationError], what: str) -> str:
    """Text of a file; `error` says that `what` is missing if it cannot be read."""
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        raise error(f"{path}: {what} is missing; copy the data set's file there.") from None


def read_table(table: Path, least: int) -> tuple[np.ndarray, np.ndarray]:
    """Stamps in nanoseconds (n,), to a float's 256 ns, and the other columns of an ASL table."""
    rows = parse_rows(table, read_text(table, FrameError, "the table"), least, ",")
    numbers = np.array(rows, dtype=float).reshape(-1, least)
    return numbers[:, 0].astype(np.int64), numbers[:, 1:]


def parse_rows(
    path: Path, text: str, least: int, separator: str | None = None
) -> Sequence[list[float]]:
    """The first `least` numbers of each line; comments and empty lines are skipped.

    Raises FrameError, naming the line, where there are fewer.
    """
    rows = []
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip() or line.startswith("#"):
            continue
        try:
            row = [float(word) for word in line.split(separator)]
        except ValueError:
            row = []
        if len(row) < least:
            raise FrameError(f"{path}, line {number}: not {least} numbers; correct that line.")
        rows.append(row[:least])
    return rows
