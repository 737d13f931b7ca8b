"""What runs over the control socket after `watch`: framed messages, and the map as tiles.

Only the standard library is needed here, as the web server reads this in a process of its own.

A frame is a length (4 bytes, big-endian, of what follows the kind), a kind (1 byte), a payload:

- `J`: a JSON object; its `type` is hello, status, pose, track, landmarks or check;
- `T`: changed tiles of the map, compressed (`pack_tiles`);
- `I`: one byte that names the eye, then a JPEG picture.

The map is cut into tiles of 32 x 32 cells on a lattice that never moves: tile (i, j) begins at the
cell 32 i, 32 j, whose outer corner is at 32 i * resolution_m in x of `world`. Rows are y. A cell is
one byte: unknown, free, swept or occupied.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable, Iterator

PROTOCOL = 1
JSON, TILES, IMAGE = b"J", b"T", b"I"
EYES = ("left", "disparity")
MAX_FRAME_BYTES = 1 << 20
TILE = 32  # cells along a side
TILE_BYTES = TILE * TILE
TILES_PER_FRAME = 48  # so many never take more than 20 KB, however the floor looks
UNKNOWN, FREE, SWEPT, OCCUPIED = range(4)

_HEAD = struct.Struct(">IB")
_PLACE = struct.Struct("<hh")

Place = tuple[int, int]


class StreamError(ValueError):
    """The other side does not speak this protocol."""


def frame(kind: bytes, payload: bytes) -> bytes:
    """One message, ready to be sent."""
    return _HEAD.pack(len(payload), kind[0]) + payload


class Unframer:
    """Cuts a byte stream back into messages."""

    def __init__(self) -> None:
        self._buffer = bytearray()

    def feed(self, data: bytes) -> Iterator[tuple[bytes, bytes]]:
        """(kind, payload) of every message that is complete now. Raises StreamError."""
        self._buffer += data
        while len(self._buffer) >= _HEAD.size:
            length, kind = _HEAD.unpack_from(self._buffer)
            if length > MAX_FRAME_BYTES:
                raise StreamError(f"a message of {length} bytes was announced")
            end = _HEAD.size + length
            if len(self._buffer) < end:
                return
            payload = bytes(self._buffer[_HEAD.size : end])
            del self._buffer[:end]
            yield bytes([kind]), payload


def pack_tiles(tiles: Iterable[tuple[Place, bytes]]) -> bytes:
    """Compressed records of (i, j, 1024 cells)."""
    records = (_PLACE.pack(*place) + cells for place, cells in tiles)
    return zlib.compress(b"".join(records), 6)


def unpack_tiles(payload: bytes) -> dict[Place, bytes]:
    """Back from `pack_tiles`. Raises StreamError."""
    limit = TILES_PER_FRAME * (_PLACE.size + TILE_BYTES)
    try:
        unzip = zlib.decompressobj()
        data = unzip.decompress(payload, limit + 1)
    except zlib.error as error:
        raise StreamError(f"tiles cannot be unpacked ({error})") from None
    size = _PLACE.size + TILE_BYTES
    if not unzip.eof or len(data) > limit or len(data) % size:
        raise StreamError("tiles of an impossible length")
    return {
        _PLACE.unpack_from(data, at): data[at + _PLACE.size : at + size]
        for at in range(0, len(data), size)
    }


def batches(tiles: dict[Place, bytes]) -> Iterator[list[tuple[Place, bytes]]]:
    """The tiles in groups that fit into one message."""
    items = list(tiles.items())
    for start in range(0, len(items), TILES_PER_FRAME):
        yield items[start : start + TILES_PER_FRAME]
