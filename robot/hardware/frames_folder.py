"""A folder of recorded frames as a camera.

Either side-by-side pictures, or `left*` and `right*` pictures, or the folders `left/` and
`right/`; pairs are made in the order of their names.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from robot.errors import FrameError
from robot.hardware.stereo import split_side_by_side
from robot.messages import StereoFrame

PICTURES = {".png", ".jpg", ".jpeg", ".pgm", ".bmp"}
_NUMBERED = re.compile(r"(\d+)")


def natural(path: Path) -> list[int | str]:
    """Sort key: numbers in the name by value, so that 10 follows 9."""
    return [int(p) if p.isdigit() else p for p in _NUMBERED.split(path.name)]


def _pictures(folder: Path) -> list[Path]:
    return sorted((p for p in folder.iterdir() if p.suffix.lower() in PICTURES), key=natural)


def list_pairs(folder: Path) -> list[tuple[Path, Path | None]]:
    """Files of each pair; the second is None where one picture holds both eyes.

    Raises FrameError for a folder that is missing, empty or has an eye without its other one.
    """
    if not folder.is_dir():
        raise FrameError(f"{folder}: no such folder; name a folder of recorded pairs.")
    if (folder / "left").is_dir() and (folder / "right").is_dir():
        left, right = _pictures(folder / "left"), _pictures(folder / "right")
    else:
        everything = _pictures(folder)
        left = [p for p in everything if p.stem.lower().startswith("left")]
        right = [p for p in everything if p.stem.lower().startswith("right")]
        if not left and not right:
            if not everything:
                raise FrameError(f"{folder}: holds no pictures; put left* and right* there.")
            return [(p, None) for p in everything]
    names = [[p.name.lower().removeprefix(side) for p in eye]
             for side, eye in (("left", left), ("right", right))]  # fmt: skip
    if names[0] != names[1]:
        odd = sorted(set(names[0]) ^ set(names[1])) or ["the order"]
        raise FrameError(
            f"{folder}: left and right pictures do not pair up (see '{odd[0]}'); "
            "give every left picture its right one."
        )
    return list(zip(left, right, strict=True))


def read_pair(left: Path, right: Path | None) -> tuple[np.ndarray, np.ndarray]:
    """Grey uint8 eyes (h, w). Raises FrameError for a file that is no picture or another size."""
    first = _read(left)
    if right is None:
        return split_side_by_side(first, str(left))
    second = _read(right)
    if first.shape != second.shape:
        raise FrameError(f"{right}: another size than {left.name}; give pairs of one size.")
    return first, second


def _read(path: Path) -> np.ndarray:
    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    if image is None:
        raise FrameError(f"{path}: cannot be read as a picture; remove it or record it again.")
    return image


class FramesFolder:
    """Delivers each pair once, `rate_hz` apart on the clock, then None."""

    def __init__(
        self,
        folder: Path,
        *,
        rate_hz: float = 0.0,
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        """`rate_hz` 0 delivers as fast as they are read. Raises FrameError."""
        self._pairs = list_pairs(folder)
        self._period_ns = round(1e9 / rate_hz) if rate_hz else 0
        self._clock = clock
        self._start_ns = clock()
        self._seq = 0
        self._closed = False
        self._last_ns = -1

    def read(self) -> StereoFrame | None:
        """The next pair; None when there is no more."""
        if self._closed or self._seq >= len(self._pairs):
            return None
        left, right = read_pair(*self._pairs[self._seq])
        due_ns = self._start_ns + self._seq * self._period_ns
        time.sleep(max(0, due_ns - self._clock()) / 1e9)
        self._last_ns = max(self._last_ns + 1, self._clock())
        frame = StereoFrame(self._last_ns, self._seq, left, right)
        self._seq += 1
        return frame

    def close(self) -> None:
        """Nothing more is delivered."""
        self._closed = True
