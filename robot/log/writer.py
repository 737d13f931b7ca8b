"""Writes a log: MCAP, in chunks small enough that a crash loses about a second.

Lossless channels, read back by `robot.log.reader` (encoding: `robot.log.codec`):

- `/event/<Type>` and `/command/<Type>`: everything that passed the loop, in order of arrival;
  the record's `sequence` is the number of the event (from 1) that a command answers;
- `/frame/FrameStamp` with `/camera/left` and `/camera/right` (PNG): frames, if recorded;
- `/truth/TruePose`: the simulator's truth.

The other channels are for people (`robot.log.people`). Times are the robot's own clock.
"""

from __future__ import annotations

import threading
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType
from typing import Any

import cv2
from mcap.writer import CompressionType, Writer

from robot.config import LogConfig
from robot.errors import LogError
from robot.geometry.se2 import SE2
from robot.log.codec import COMMANDS, EVENTS, FrameStamp, TruePose, encode
from robot.log.foxglove import calibration, png_image
from robot.log.header import METADATA_NAME, LogHeader
from robot.log.people import PeopleChannels
from robot.log.schemas import json_schema, protobuf_schema
from robot.messages import Command, Event, StereoFrame

_FASTEST_PNG = [cv2.IMWRITE_PNG_COMPRESSION, 1]
_SEQUENCE = 2**32  # MCAP's sequence is an unsigned 32-bit number


class LogWriter:
    """The log of one life: `EventLog` for the loop, `Recorder` for the body.

    The two may be called from different threads: live, frames come from the camera's.
    Raises LogError if the file cannot be created. Close it (or use it as a context) to give the
    file its index; an unclosed log is still readable up to its last `flush` or full chunk.
    """

    def __init__(self, path: Path, header: LogHeader, config: LogConfig | None = None) -> None:
        """`config` overrides the header's; the robot's width always comes from the header."""
        effective = header.config()
        config = config or effective.log
        try:
            self._file = open(path, "wb")  # noqa: SIM115 (closed in close)
        except OSError as error:
            raise LogError(
                f"{path}: the log cannot be written ({error.strerror}); give a writable folder."
            ) from None
        self._writer = Writer(
            self._file, chunk_size=config.chunk_bytes, compression=CompressionType.ZSTD
        )
        self._writer.start(profile="sweeper", library=f"sweeper {header.software}")
        self._writer.add_metadata(METADATA_NAME, header.to_metadata())
        self._lock = threading.RLock()
        self._channels: dict[str, int] = {}
        self._by_type: dict[type, int] = {}
        self._register_lossless("event", EVENTS.values())
        self._register_lossless("command", COMMANDS.values())
        self._register_lossless("frame", [FrameStamp])
        self._register_lossless("truth", [TruePose])
        self._people = PeopleChannels(self._put, config, effective.robot, header.camera)
        # Raw frames do not obey the rectified camera; their calibration is in the header.
        self._frames_camera = None if header.calibration else header.camera
        self._calibrated = False
        self._events = 0
        self._now_ns = 0

    # ---------------------------------------------------------------- EventLog

    def event(self, event: Event) -> None:
        """Write an event that is about to reach the brain."""
        self._events += 1
        arrived_ns = getattr(event, "arrived_ns", event.t_ns)
        self._now_ns = arrived_ns
        self._add(self._by_type[type(event)], arrived_ns, event.t_ns, encode(event), self._events)
        self._people.event(event, arrived_ns)

    def command(self, command: Command) -> None:
        """Write a command or report with which the brain answered the last event."""
        channel = self._by_type[type(command)]
        self._add(channel, self._now_ns, command.t_ns, encode(command), self._events)
        self._people.command(command, self._now_ns)

    def flush(self) -> None:
        """Hand everything so far to the operating system."""
        with self._lock:
            self._writer.flush()

    # ---------------------------------------------------------------- Recorder

    def frame(self, frame: StereoFrame) -> None:
        """Write a pair of images without loss."""
        t_ns, seq = frame.t_ns, frame.seq
        if not self._calibrated and self._frames_camera is not None:
            self._calibrated = True
            for side, right in (("left", False), ("right", True)):
                message = calibration(t_ns, self._frames_camera, right=right)
                self._put(f"/camera/{side}/calibration", message, t_ns)
        for side, image in (("left", frame.left), ("right", frame.right)):
            png = cv2.imencode(".png", image, _FASTEST_PNG)[1].tobytes()
            self._put(f"/camera/{side}", png_image(t_ns, png), t_ns, seq)
        stamp = FrameStamp(t_ns, seq, frame.yaw_change_rad)
        self._add(self._by_type[FrameStamp], t_ns, t_ns, encode(stamp), seq)

    def truth(self, t_ns: int, world_from_base: SE2) -> None:
        """Write where the robot really is, in the frame of the estimate (simulator only)."""
        truth = TruePose(t_ns, world_from_base)
        self._add(self._by_type[TruePose], t_ns, t_ns, encode(truth), self._events)
        self._people.truth(t_ns, world_from_base)

    # ---------------------------------------------------------------- the file

    def close(self) -> None:
        """Write the index and close the file; closing twice is harmless."""
        with self._lock:
            if not self._file.closed:
                self._writer.finish()
                self._file.close()

    def __enter__(self) -> LogWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def _add(self, channel: int, log_ns: int, t_ns: int, data: bytes, sequence: int) -> None:
        with self._lock:
            self._writer.add_message(
                channel, max(0, log_ns), data, max(0, t_ns), sequence % _SEQUENCE
            )

    def _register_lossless(self, kind: str, types: Iterable[type]) -> None:
        for message in types:
            name = message.__name__
            schema = self._writer.register_schema(
                f"sweeper.{name}", "jsonschema", json_schema(message)
            )
            self._by_type[message] = self._writer.register_channel(
                f"/{kind}/{name}", "json", schema
            )

    def _put(self, topic: str, message: Any, t_ns: int, sequence: int = 0) -> None:
        """Write a protobuf message on a channel for people."""
        with self._lock:
            channel = self._channels.get(topic)
            if channel is None:
                channel = self._channels[topic] = self._register(topic, message)
        self._add(channel, t_ns, t_ns, message.SerializeToString(), sequence)

    def _register(self, topic: str, message: Any) -> int:
        schema = self._writer.register_schema(
            message.DESCRIPTOR.full_name, "protobuf", protobuf_schema(type(message))
        )
        return self._writer.register_channel(topic, "protobuf", schema)
