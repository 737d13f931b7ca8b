"""What every stereo camera gives, and a watchman that starts a lost one again."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

import cv2
import numpy as np

from robot.errors import FrameError, HardwareError
from robot.messages import StereoFrame

FIRST_REST_S, LONGEST_REST_S = 0.5, 8.0


class StereoSource(Protocol):
    """A camera for one reader. `tests/contract/test_stereo_sources.py` is its contract.

    `read` waits a bounded time for the newest pair: grey uint8, contiguous, both eyes of one
    exposure and one size, `t_ns` when it was exposed (monotonic, never in the future), `seq`
    rising, with gaps where frames were lost. None: nothing came, now or ever again. `close` gives
    the device back and may be called twice.
    """

    def read(self) -> StereoFrame | None: ...

    def close(self) -> None: ...


class WatchedStereo:
    """Reads from a camera, and opens it anew when it has stopped delivering.

    The first opening may raise; later ones are tried again with growing rests, while `read`
    returns None at once, so that the reader sees a stale view and never a blocked call.
    """

    def __init__(
        self,
        open_source: Callable[[], StereoSource],
        *,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._open, self._clock = open_source, clock
        self._source: StereoSource | None = open_source()
        self._rest_s, self._next_try_s = FIRST_REST_S, 0.0
        self._offset, self._last_seq = 0, -1
        self.restarts = 0
        self.problem = ""  # why there is no picture now; empty while there is one

    def read(self) -> StereoFrame | None:
        """The next pair, numbered on across restarts; None while there is no camera."""
        if self._source is None and not self._reopen():
            return None
        assert self._source is not None
        try:
            frame = self._source.read()
            self.problem = "" if frame is not None else "the camera stopped delivering"
        except (HardwareError, FrameError) as error:
            frame, self.problem = None, str(error)
        if frame is None:
            self._source.close()
            self._source = None
            self._next_try_s = self._clock() + self._rest_s
            self._rest_s = min(2.0 * self._rest_s, LONGEST_REST_S)
            return None
        self._rest_s = FIRST_REST_S
        seq = frame.seq + self._offset
        if seq <= self._last_seq:  # it has started to count anew
            self._offset += self._last_seq + 1 - seq
            seq = self._last_seq + 1
        self._last_seq = seq
        return replace(frame, seq=seq)

    @property
    def difference_ns(self) -> int:
        """Time between the two eyes' exposures of the latest pair, where the source knows it."""
        return int(getattr(self._source, "difference_ns", 0))

    def close(self) -> None:
        """Give the device back; no further attempt is made."""
        self._next_try_s = float("inf")
        if self._source is not None:
            self._source.close()
            self._source = None

    def _reopen(self) -> bool:
        if self._clock() < self._next_try_s:
            return False
        try:
            self._source = self._open()
        except HardwareError as error:
            self.problem = str(error)
            self._next_try_s = self._clock() + self._rest_s
            self._rest_s = min(2.0 * self._rest_s, LONGEST_REST_S)
            return False
        self.restarts += 1
        return True


def split_side_by_side(image: np.ndarray, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Cut one frame (h, 2w) or (h, 2w, 3) into two contiguous grey eyes (h, w) uint8.

    Raises FrameError when the frame is not as wide as two eyes.
    """
    if image.dtype != np.uint8 or image.ndim not in (2, 3) or image.shape[1] % 2:
        raise FrameError(
            f"{name}: a frame of shape {image.shape} and type {image.dtype} is not two 8-bit eyes "
            "side by side; choose a side-by-side mode of the camera."
        )
    grey = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    half = grey.shape[1] // 2
    return np.ascontiguousarray(grey[:, :half]), np.ascontiguousarray(grey[:, half:])
