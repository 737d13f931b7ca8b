"""Perception with an eye on the eyes: tells when a camera no longer stands as calibrated."""

from __future__ import annotations

from typing import Protocol

from robot.messages import Seen, StereoFrame
from robot.perception.epipolar import EpipolarWatch
from robot.perception.rectify import Rectifier

EVERY = 50  # frames: at 10 Hz, one look in five seconds


class See(Protocol):
    """The perception chain."""

    def see(self, frame: StereoFrame, arrived_ns: int) -> Seen: ...


class WatchedPerception:
    """The same as the chain within; `problem` says what the watch has found."""

    def __init__(self, chain: See, rectifier: Rectifier | None, every: int = EVERY) -> None:
        self._chain, self._rectifier, self._every = chain, rectifier, every
        self._watch = EpipolarWatch()
        self._count = 0

    @property
    def problem(self) -> str:
        """In words; empty while all is well."""
        return self._watch.problem

    def see(self, frame: StereoFrame, arrived_ns: int) -> Seen:
        """See as the chain does."""
        seen = self._chain.see(frame, arrived_ns)
        self._count += 1
        if self._count % self._every == 0:
            left, right = frame.left, frame.right
            if self._rectifier is not None:
                left, right = self._rectifier.rectify(left, right)
            self._watch.look(left, right)
        return seen
