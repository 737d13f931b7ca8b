"""The file under a log: MCAP records one after the other, with every way it can be cut or damaged.

Format: MCAP specification, version 0 (opcode, 64-bit length, content; little-endian).
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from typing import BinaryIO, Literal, NamedTuple

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Metadata

from robot.errors import LogError

MAGIC = b"\x89MCAP0\r\n"
MAX_CHUNK_BYTES = 1 << 30  # a larger one is a damaged length, not a log of ours
_PREFIX = struct.Struct("<BQ")
_CHUNK = struct.Struct("<QQQI")  # start, end, uncompressed size, CRC-32
_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_LENGTH, _LENGTH8 = struct.Struct("<I"), struct.Struct("<Q")

Ending = Literal["complete", "truncated", "damaged"]


class Raw(NamedTuple):
    """One record of the file."""

    opcode: int
    offset: int
    content: bytes


class RawMessage(NamedTuple):
    """One message of a chunk."""

    topic: str
    sequence: int
    log_ns: int
    data: bytes


class Damage(Exception):
    """A record does not hold what it must; the text says what is wrong."""


def open_log(path: os.PathLike[str] | str) -> BinaryIO:
    """Open an MCAP file behind its magic. Raises LogError if it is missing or something else."""
    try:
        file = open(path, "rb")  # noqa: SIM115 (the caller closes it)
        magic = file.read(len(MAGIC))
    except OSError as error:
        raise LogError(
            f"{path}: the log cannot be read ({error.strerror}); give the log.mcap of a run."
        ) from None
    if magic != MAGIC:
        file.close()
        what = "is empty" if not magic else "is not an MCAP file"
        raise LogError(f"{path}: {what}; give the log.mcap of a run.")
    return file


def read_records(file: BinaryIO) -> Iterator[Raw]:
    """Every whole record from the file's position on; returns at the end or at a cut."""
    size = os.fstat(file.fileno()).st_size
    while True:
        offset = file.tell()
        prefix = file.read(_PREFIX.size)
        if len(prefix) < _PREFIX.size:
            return
        opcode, length = _PREFIX.unpack(prefix)
        if offset + _PREFIX.size + length > size:
            return
        yield Raw(opcode, offset, file.read(length))


def ends_whole(file: BinaryIO) -> bool:
    """Whether the file was closed properly: it ends with the magic again."""
    place = file.tell()
    file.seek(0, os.SEEK_END)
    size = file.tell()
    file.seek(max(len(MAGIC), size - len(MAGIC)))
    whole = file.read() == MAGIC
    file.seek(place)
    return whole


def open_chunk(content: bytes) -> bytes:
    """The uncompressed records of a chunk. Raises Damage if its checksum does not fit."""
    try:
        _, _, size, crc = _CHUNK.unpack_from(content)
        name_at = _CHUNK.size + _LENGTH.size
        (name_length,) = _LENGTH.unpack_from(content, _CHUNK.size)
        compression = content[name_at : name_at + name_length]
        (length,) = _LENGTH8.unpack_from(content, name_at + name_length)
        data = content[name_at + name_length + _LENGTH8.size :]
        if len(data) != length or size > MAX_CHUNK_BYTES:
            raise Damage("a chunk's lengths contradict each other")
        records = _decompress(compression, data, size)
    except (struct.error, zstandard.ZstdError) as error:
        raise Damage(f"a chunk cannot be unpacked ({error})") from None
    if len(records) != size or (crc and zlib.crc32(records) != crc):
        raise Damage("a chunk's checksum is wrong")
    return records


def _decompress(compression: bytes, data: bytes, size: int) -> bytes:
    if compression == b"":
        return data
    if compression != b"zstd":
        raise Damage(f"compression {compression.decode(errors='replace')!r} is unknown")
    if zstandard.get_frame_parameters(data).content_size not in (size, 2**64 - 1):
        raise Damage("a chunk's lengths contradict each other")
    return bytes(zstandard.decompress(data, max_output_size=size))


def chunk_messages(records: bytes, topics: dict[int, str]) -> Iterator[RawMessage]:
    """Messages of an opened chunk; `topics` by channel is extended as channels are declared.

    Raises Damage if the records do not fill the chunk.
    """
    place, size = 0, len(records)
    try:
        while place < size:
            opcode, length = _PREFIX.unpack_from(records, place)
            place += _PREFIX.size
            if place + length > size:
                raise Damage("a record reaches beyond its chunk")
            if opcode == Opcode.MESSAGE:
                channel, sequence, log_ns, _ = _MESSAGE.unpack_from(records, place)
                data = records[place + _MESSAGE.size : place + length]
                yield RawMessage(topics.get(channel, ""), sequence, log_ns, data)
            elif opcode == Opcode.CHANNEL:
                channel_record = Channel.read(as_stream(records[place : place + length]))
                topics[channel_record.id] = channel_record.topic
            place += length
    except struct.error as error:
        raise Damage(f"a chunk's records cannot be read ({error})") from None


def parse_metadata(content: bytes) -> Metadata:
    """A metadata record. Raises Damage."""
    try:
        return Metadata.read(as_stream(content))
    except Exception as error:  # whatever mcap meets in damaged bytes
        raise Damage(f"the header cannot be read ({type(error).__name__})") from None


def as_stream(content: bytes) -> ReadDataStream:
    """Bytes as mcap's record parsers want them."""
    return ReadDataStream(BytesIO(content))
