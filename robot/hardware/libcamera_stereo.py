"""Cameras on the board's own connectors, through libcamera in a process of its own.

One camera that delivers both eyes side by side (a synchronised HAT: the way on a board with one
connector), or two cameras whose frames are matched by the time of their exposure (Pi 5, Compute
Module). Both give the same: the newest pair, taken when it was exposed.
"""

from __future__ import annotations

import json
import mmap
import os
import selectors
import subprocess
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from robot.errors import HardwareError
from robot.hardware.libcamera_child import READY, RECORD
from robot.messages import StereoFrame

CHILD = Path(__file__).with_name("libcamera_child.py")
START_S = 20.0  # the system's Python and libcamera load slowly from a card
TOLERANCE_US = 1000  # two eyes farther apart are no pair
_WORDS_KEPT = 4000


class LibcameraStereo:
    """Newest pair of one composite camera, or of two. One reader.

    `read` returns None when no frame came within `timeout_s`; the process is then ended, as a
    pipeline that hangs does not recover, and later reads return None until a new object is made.
    Raises HardwareError when the cameras cannot be started.
    """

    def __init__(
        self,
        cameras: Sequence[str],
        *,
        eye_width_px: int,
        eye_height_px: int,
        rate_hz: float,
        exposure_us: int = 0,
        gain: float = 1.0,
        timeout_s: float = 1.0,
        python: Sequence[str] = ("/usr/bin/python3",),
        child: Path = CHILD,
        environment: Mapping[str, str] | None = None,
    ) -> None:
        self.name = "libcamera " + ", ".join(cameras)
        self.difference_ns = 0  # right minus left exposure of the latest pair
        self._timeout_s = timeout_s
        self._shape = (eye_height_px, 2 * eye_width_px)
        memory_fd = os.memfd_create("sweeper-frames")
        os.ftruncate(memory_fd, self._shape[0] * self._shape[1])
        self._memory = mmap.mmap(memory_fd, self._shape[0] * self._shape[1])
        setting = {
            "cameras": list(cameras),
            "width": 2 * eye_width_px if len(cameras) == 1 else eye_width_px,
            "height": eye_height_px,
            "rate_hz": rate_hz,
            "exposure_us": exposure_us,
            "gain": gain,
            "tolerance_us": TOLERANCE_US,
            "memory_fd": memory_fd,
        }
        try:
            self._process = subprocess.Popen(
                [*python, str(child), json.dumps(setting)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                bufsize=0,
                pass_fds=[memory_fd],
                env=_environment(environment),
            )
        except OSError as error:
            raise HardwareError(
                f"{python[0]}: {error.strerror}; install Python from the distribution, "
                "`sudo apt install python3-libcamera`."
            ) from None
        finally:
            os.close(memory_fd)
        self._words = b""
        self._selector = selectors.DefaultSelector()
        for pipe in (self._process.stdout, self._process.stderr):
            assert pipe is not None
            self._selector.register(pipe, selectors.EVENT_READ)
        first = self._record(START_S)
        if first is None or first[0] != READY:
            self.close()
            raise HardwareError(f"camera.device: {self._complaint()}")

    def read(self) -> StereoFrame | None:
        """Wait for the next pair; None when the cameras have stopped delivering."""
        if self._process.poll() is not None:
            return None
        try:
            assert self._process.stdin is not None
            self._process.stdin.write(b"n")
        except OSError:
            return None
        record = self._record(self._timeout_s)
        if record is None:
            self.close()
            return None
        seq, t_ns, self.difference_ns = record
        both = np.frombuffer(self._memory, np.uint8).reshape(self._shape)
        half = self._shape[1] // 2
        left, right = both[:, :half].copy(), both[:, half:].copy()
        return StereoFrame(t_ns, seq, left, right)

    def close(self) -> None:
        """End the process; safe to call again."""
        process = self._process
        if process.poll() is None:
            process.kill()
        process.wait()
        for pipe in (process.stdin, process.stdout, process.stderr):
            if pipe is not None and not pipe.closed:
                pipe.close()
        self._selector.close()

    def _record(self, timeout_s: float) -> tuple[int, int, int] | None:
        """The next record; None when it does not come in time or the process has ended."""
        end_s = time.monotonic() + timeout_s
        got = b""
        while (left_s := end_s - time.monotonic()) > 0.0:
            for key, _ in self._selector.select(left_s):
                chunk = os.read(key.fd, RECORD.size - len(got) if self._is_stdout(key.fd) else 4096)
                if self._is_stdout(key.fd):
                    if not chunk:
                        self._drain_words()
                        return None
                    got += chunk
                elif chunk:
                    self._words = (self._words + chunk)[-_WORDS_KEPT:]
                else:
                    self._selector.unregister(key.fileobj)
            if len(got) == RECORD.size:
                return RECORD.unpack(got)
        return None

    def _is_stdout(self, fd: int) -> bool:
        return self._process.stdout is not None and fd == self._process.stdout.fileno()

    def _drain_words(self) -> None:
        """The process has ended: its last words are all there."""
        if self._process.stderr is not None:
            self._words = (self._words + self._process.stderr.read())[-_WORDS_KEPT:]

    def _complaint(self) -> str:
        lines = self._words.decode(errors="replace").splitlines()
        ours = [line for line in lines if line.startswith("sweeper: ")]
        if ours:
            return ours[-1].removeprefix("sweeper: ")
        last = lines[-1] if lines else "it said nothing"
        return f"libcamera did not start ({last.strip()}); check `cam --list` and the cables."


def _environment(extra: Mapping[str, str] | None) -> dict[str, str]:
    """Without this process's own Python settings: the child is the system's."""
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "VIRTUAL_ENV"))}
    return {**kept, "LIBCAMERA_LOG_LEVELS": "*:ERROR", **(extra or {})}
