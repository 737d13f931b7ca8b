"""Reads a log, streaming, in order of arrival.

A log that was cut short gives everything up to its last complete chunk; `ending` says so
afterwards, and `require_complete` refuses it beforehand.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, cast

import cv2
import numpy as np
from mcap.opcode import Opcode

from robot.errors import LogError
from robot.geometry.se2 import SE2
from robot.log.chunks import (
    Damage,
    Ending,
    RawMessage,
    chunk_messages,
    ends_whole,
    open_chunk,
    open_log,
    parse_metadata,
    read_records,
)
from robot.log.codec import COMMANDS, EVENTS, FrameStamp, TruePose, decode
from robot.log.header import METADATA_NAME, LogHeader
from robot.messages import Command, Event, StereoFrame

Kind = Literal["event", "command", "frame", "truth"]
_TYPES: dict[str, tuple[Kind, type]] = {
    **{f"/event/{name}": ("event", kind) for name, kind in EVENTS.items()},
    **{f"/command/{name}": ("command", kind) for name, kind in COMMANDS.items()},
    "/frame/FrameStamp": ("frame", FrameStamp),
    "/truth/TruePose": ("truth", TruePose),
}
_EYES = ("/camera/left", "/camera/right")


@dataclass(frozen=True, slots=True)
class Entry:
    """One lossless record: `number` counts the event that it is, or that it answers.

    `text` is what `robot.log.codec.encode` made of the message.
    """

    kind: Kind
    type: type
    number: int
    text: bytes
    images: tuple[bytes, bytes] | None = None  # of a frame: its two CompressedImage messages

    def message(self) -> Any:
        """The event, command, StereoFrame or TruePose. Raises ValueError."""
        message = decode(self.type, self.text)
        if self.images is None:
            return message
        left, right = (_grey(image) for image in self.images)
        return StereoFrame(message.t_ns, message.seq, left, right, message.yaw_change_rad)


class LogReader:
    """A log that is open for reading; use it as a context."""

    def __init__(self, path: Path | str) -> None:
        """Raises LogError if the file is missing, not a log of ours, or cut before its start."""
        self.path = Path(path)
        self.ending: Ending | None = None
        self.problem = ""
        self._file = open_log(path)
        try:
            self.header = self._read_header()
        except BaseException:
            self._file.close()
            raise

    def require_complete(self) -> None:
        """Raise LogError if the log was not closed properly."""
        if not ends_whole(self._file):
            self._end("truncated", "it has no end, its writer was interrupted")
            raise self.error()

    def error(self) -> LogError:
        """What is wrong with the file, once it was found to be truncated or damaged."""
        return LogError(
            f"{self.path}: the log is {self.ending} ({self.problem}); copy its readable part with "
            f"`sweeper log recover {self.path} OUT.mcap` and use that."
        )

    def entries(self, kinds: Collection[Kind]) -> Iterator[Entry]:
        """Lossless records of these kinds, in order of arrival, from here to the end."""
        images: dict[str, tuple[int, bytes]] = {}
        for message in self._messages():
            if message.topic in _EYES:
                images[message.topic] = (message.sequence, message.data)
            kind, type_ = _TYPES.get(message.topic, (None, None))
            if kind is None or type_ is None or kind not in kinds:
                continue
            pair = None
            if kind == "frame":
                pair = self._pair(images, message.sequence)
            yield Entry(kind, type_, message.sequence, message.data, pair)

    def messages(self, kind: Kind) -> Iterator[Any]:
        """Decoded records of one kind. Raises LogError if another version wrote them."""
        for entry in self.entries((kind,)):
            yield self.decoded(entry)

    def decoded(self, entry: Entry) -> Any:
        """The entry's message. Raises LogError if another version wrote it."""
        try:
            return entry.message()
        except ValueError as error:
            raise LogError(
                f"{self.path}: record {entry.number} is {error}; it was written by Sweeper "
                f"{self.header.software}, read it with that version."
            ) from None

    def close(self) -> None:
        self._file.close()

    def __enter__(self) -> LogReader:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    # ---------------------------------------------------------------- parts

    def _read_header(self) -> LogHeader:
        for record in read_records(self._file):
            if record.opcode == Opcode.METADATA:
                try:
                    metadata = parse_metadata(record.content)
                except Damage as damage:
                    self._end("damaged", str(damage))
                    raise LogError(
                        f"{self.path}: {damage}, nothing can be saved; use another log."
                    ) from None
                if metadata.name == METADATA_NAME:
                    return LogHeader.from_metadata(metadata.metadata, str(self.path))
            elif record.opcode != Opcode.HEADER:
                break
        raise LogError(
            f"{self.path}: the log has no Sweeper header (cut at its start, or written by another "
            "program); use the log.mcap of a run."
        )

    def _messages(self) -> Iterator[RawMessage]:
        topics: dict[int, str] = {}
        for record in read_records(self._file):
            if record.opcode == Opcode.CHUNK:
                try:
                    yield from chunk_messages(open_chunk(record.content), topics)
                except Damage as damage:
                    self._end("damaged", f"{damage}, at byte {record.offset}")
                    return
            elif record.opcode == Opcode.DATA_END:
                break
        if ends_whole(self._file):
            self._end("complete", "")
        else:
            self._end("truncated", f"it breaks off at byte {self._file.tell()}")

    def _end(self, ending: Ending, problem: str) -> None:
        self.ending, self.problem = ending, problem

    def _pair(self, images: dict[str, tuple[int, bytes]], sequence: int) -> tuple[bytes, bytes]:
        (left_seq, left), (right_seq, right) = (images.get(eye, (-1, b"")) for eye in _EYES)
        if not left_seq == right_seq == sequence:
            raise LogError(f"{self.path}: frame {sequence} lacks an image; record the run again.")
        return left, right


def _grey(compressed_image: bytes) -> np.ndarray:
    from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage

    png = CompressedImage.FromString(compressed_image).data
    image = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise ValueError("not a PNG image")
    return cast(np.ndarray, image)


# ---------------------------------------------------------------- in one call


def read_header(path: Path | str) -> LogHeader:
    """What the log says about itself. Raises LogError."""
    with LogReader(path) as log:
        return log.header


def read_events(path: Path | str) -> Iterator[Event]:
    """Every event, in order of arrival. Raises LogError."""
    with LogReader(path) as log:
        yield from log.messages("event")


def read_commands(path: Path | str) -> Iterator[Command]:
    """Every command and report, in order. Raises LogError."""
    with LogReader(path) as log:
        yield from log.messages("command")


def read_frames(path: Path | str) -> Iterator[StereoFrame]:
    """Every recorded pair, in order of writing. Raises LogError."""
    with LogReader(path) as log:
        yield from log.messages("frame")


def read_truth(path: Path | str) -> Iterator[tuple[int, SE2]]:
    """Every true pose with its time, in the frame of the estimate. Raises LogError."""
    with LogReader(path) as log:
        for truth in log.messages("truth"):
            yield truth.t_ns, truth.world_from_base
