"""The recorded body: stereo frames from a folder, seen again in the order of their stamps.

Perception runs inline. The clock is the recording's: ticks fill the time between frames, and where
there is a gyro its samples are averaged over each tick.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from robot.body.recording_files import read_grey
from robot.body.recordings import PairFiles, Recording
from robot.messages import Command, Event, ImuSample, Seen, StereoFrame, Tick

NS = 1_000_000_000
TICK_NS = NS // 50
_EDGE_S = 0.01  # a gyro may begin and end this much within the frames


class Sees(Protocol):
    """What `robot.perception.chain.Perception` offers here."""

    def see(self, frame: StereoFrame, arrived_ns: int) -> Seen: ...


@dataclass
class FrameCount:
    """What became of the pairs of a recording."""

    seen: int = 0
    lost: int = 0  # an eye is missing, or its file cannot be read
    reordered: int = 0  # stamped no later than the one before: never shown
    read_ms: list[float] = field(default_factory=list)  # opening and decoding both images


class RecordedBody:
    """Lives through a recording; commands are collected and move nothing.

    `gyro_up` (3,) is the robot's z axis in the left camera's frame: the axis whose turn rate the
    robot feels.
    """

    def __init__(self, recording: Recording, perception: Sees, gyro_up: np.ndarray) -> None:
        self._recording = recording
        self._perception = perception
        self._start_ns = recording.pairs[0].t_ns
        self._gyro_s = recording.gyro[:, 0]
        rates = recording.gyro[:, 1:] @ gyro_up
        # The integral of the rate up to each sample: any average is then one difference.
        steps = np.diff(self._gyro_s, prepend=self._gyro_s[:1])
        self._gyro_yaw = np.cumsum(rates * steps)
        self.count = FrameCount()
        self.commands: list[Command] = []

    def events(self) -> Iterator[Event]:
        """Ticks, turn rates and what was seen, in the order of time."""
        now_ns = self._start_ns
        last_frame_ns: int | None = None
        for seq, pair in enumerate(self._recording.pairs):
            if pair.left is None or pair.right is None:
                self.count.lost += 1
                continue
            if last_frame_ns is not None and pair.t_ns <= last_frame_ns:
                self.count.reordered += 1
                continue
            while now_ns + TICK_NS <= pair.t_ns:
                now_ns += TICK_NS
                yield from self._beat(now_ns)
            frame = self._read(pair, seq, last_frame_ns)
            if frame is None:
                self.count.lost += 1
                continue
            last_frame_ns = pair.t_ns
            self.count.seen += 1
            yield self._perception.see(frame, pair.t_ns)
        yield from self._beat(now_ns + TICK_NS)

    def send(self, command: Command) -> None:
        """Keep the command."""
        self.commands.append(command)

    def _beat(self, now_ns: int) -> Iterator[Event]:
        yaw = self._turned(now_ns - TICK_NS, now_ns)
        if math.isfinite(yaw):
            yield ImuSample(now_ns, yaw * NS / TICK_NS)
        yield Tick(now_ns)

    def _read(self, pair: PairFiles, seq: int, last_frame_ns: int | None) -> StereoFrame | None:
        before_ns = time.perf_counter_ns()
        left, right = read_grey(pair.left), read_grey(pair.right)
        self.count.read_ms.append((time.perf_counter_ns() - before_ns) / 1e6)
        if left is None or right is None:
            return None
        yaw = math.nan if last_frame_ns is None else self._turned(last_frame_ns, pair.t_ns)
        return StereoFrame(pair.t_ns, seq, left, right, yaw)

    def _turned(self, from_ns: int, to_ns: int) -> float:
        """Yaw between two times by the gyro; NaN where it was not recorded."""
        start, end = ((t - self._start_ns) / NS for t in (from_ns, to_ns))
        known_s = self._gyro_s
        if not known_s.size or start < known_s[0] - _EDGE_S or end > known_s[-1] + _EDGE_S:
            return math.nan
        before, after = np.interp([start, end], known_s, self._gyro_yaw)
        return float(after - before)
