"""Copies a part of a log: a span of time, with or without its pictures."""

from __future__ import annotations

from pathlib import Path

from mcap.records import Chunk, Message
from mcap.writer import Writer

from robot.errors import LogError
from robot.log.reader import LogReader
from robot.log.recover import Copier, Recovered, copy_chunks, create_copy

NS = 1_000_000_000
PICTURES = ("/camera/", "/frame/")


class _Cutter(Copier):
    """Copies what lies between two times after the first message."""

    def __init__(self, writer: Writer, start_s: float, end_s: float, *, pictures: bool) -> None:
        super().__init__(writer)
        self._start_s, self._end_s, self._pictures = start_s, end_s, pictures
        self._zero_ns: int | None = None
        self._topics: dict[int, str] = {}

    def chunk(self, chunk: Chunk) -> None:
        """Copy the wanted messages of one chunk."""
        from mcap.records import Channel
        from mcap.stream_reader import breakup_chunk

        for record in breakup_chunk(chunk):
            if isinstance(record, Channel):
                self._topics[record.id] = record.topic
        super().chunk(chunk)

    def _message(self, message: Message) -> None:
        if self._zero_ns is None:
            self._zero_ns = message.log_time
        at_s = (message.log_time - self._zero_ns) / NS
        picture = self._topics.get(message.channel_id, "").startswith(PICTURES)
        if self._start_s <= at_s <= self._end_s and (self._pictures or not picture):
            super()._message(message)


def cut(
    path: Path | str, out: Path | str, start_s: float, end_s: float, *, pictures: bool = True
) -> Recovered:
    """Write the messages from `start_s` to `end_s`, seconds after the log's first, to a new log.

    Of a damaged log, up to its first damage. Raises LogError if there is nothing to read or
    nothing in the span, or if `out` exists or cannot be written.
    """
    if not 0.0 <= start_s < end_s:
        raise LogError(f"a cut from {start_s} s to {end_s} s is empty; give 0 <= FROM < TO.")
    with LogReader(path) as log:
        metadata, library = log.header.to_metadata(), f"sweeper {log.header.software}"
    metadata["extra.cut"] = f"{start_s} to {end_s} s"
    with create_copy(out, library, metadata) as writer:
        cutter = _Cutter(writer, start_s, end_s, pictures=pictures)
        chunks, problem = copy_chunks(Path(path), cutter)
    if not cutter.messages:
        Path(out).unlink()
        raise LogError(f"{path}: nothing lies between {start_s} s and {end_s} s; see `log info`.")
    return Recovered(cutter.messages, chunks, cutter.seconds, problem)
