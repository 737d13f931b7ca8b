"""Saves what a cut or damaged log still holds."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Message, Schema
from mcap.stream_reader import breakup_chunk
from mcap.writer import CompressionType, Writer

from robot.errors import LogError
from robot.log.chunks import Damage, as_stream, ends_whole, open_chunk, open_log, read_records
from robot.log.header import METADATA_NAME
from robot.log.reader import LogReader


@dataclass(frozen=True, slots=True)
class Recovered:
    """What was saved: messages of the leading good chunks, and the robot's time they span."""

    messages: int
    chunks: int
    seconds: float
    problem: str  # empty: the log was complete already

    def sentence(self) -> str:
        """One line for people."""
        lost = f"; lost after that: {self.problem}" if self.problem else "; nothing was missing"
        return f"saved {self.messages} messages over {self.seconds:.1f} s{lost}."


def recover(path: Path | str, out: Path | str) -> Recovered:
    """Write the readable part of the log at `path` to a complete log at `out`.

    Stops at the first damage: what follows a gap could not be replayed. Raises LogError if nothing
    can be read, or `out` cannot be written or exists.
    """
    with LogReader(path) as log:  # refuses what has no header
        metadata = log.header.to_metadata()
        library = f"sweeper {log.header.software}"
    with create_copy(out, library, metadata) as writer:
        copier = Copier(writer)
        chunks, problem = copy_chunks(Path(path), copier)
    return Recovered(copier.messages, chunks, copier.seconds, problem)


@contextmanager
def create_copy(out: Path | str, library: str, metadata: dict[str, str]) -> Iterator[Writer]:
    """The writer of a new log that is a copy; finished at the end. Raises LogError."""
    try:
        target = open(out, "xb")  # noqa: SIM115 (closed below)
    except OSError as error:
        raise LogError(
            f"{out}: cannot be created ({error.strerror}); give a new file in a writable folder."
        ) from None
    with target:
        writer = Writer(target, chunk_size=1 << 18, compression=CompressionType.ZSTD)
        writer.start(profile="sweeper", library=library)
        writer.add_metadata(METADATA_NAME, metadata)
        yield writer
        writer.finish()


def copy_chunks(path: Path, copier: Copier) -> tuple[int, str]:
    """Copy whole chunks until the end or the first damage: their count, and what was wrong."""
    chunks = 0
    with open_log(path) as file:
        problem = "" if ends_whole(file) else "the file has no end"
        for record in read_records(file):
            if record.opcode == Opcode.DATA_END:
                break
            if record.opcode != Opcode.CHUNK:
                continue
            try:
                open_chunk(record.content)
                copier.chunk(Chunk.read(as_stream(record.content)))
            except Damage as damage:
                return chunks, f"{damage}, at byte {record.offset}"
            chunks += 1
    return chunks, problem


class Copier:
    """Writes the records of chunks, renumbering schemas and channels."""

    def __init__(self, writer: Writer) -> None:
        self._writer = writer
        self._schemas: dict[int, int] = {0: 0}
        self._channels: dict[int, int] = {}
        self._first_ns: int | None = None
        self._last_ns = 0
        self.messages = 0

    @property
    def seconds(self) -> float:
        """Time between the first and the last message."""
        return (self._last_ns - (self._first_ns or 0)) / 1e9

    def chunk(self, chunk: Chunk) -> None:
        """Copy one chunk whose checksum is right."""
        for record in breakup_chunk(chunk):
            if isinstance(record, Schema):
                self._schemas[record.id] = self._writer.register_schema(
                    record.name, record.encoding, record.data
                )
            elif isinstance(record, Channel):
                self._channels[record.id] = self._writer.register_channel(
                    record.topic, record.message_encoding, self._schemas[record.schema_id]
                )
            elif isinstance(record, Message):
                self._message(record)

    def _message(self, message: Message) -> None:
        self._writer.add_message(
            self._channels[message.channel_id],
            message.log_time,
            message.data,
            message.publish_time,
            message.sequence,
        )
        if self._first_ns is None:
            self._first_ns = message.log_time
        self._last_ns = max(self._last_ns, message.log_time)
        self.messages += 1
