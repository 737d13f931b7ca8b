"""The map as a PNG, with the standard library alone: this process does without numpy.

Format: Portable Network Graphics (Third Edition), indexed colour, 8 bits.
"""

from __future__ import annotations

import struct
import zlib

from robot.body.talk.stream import OCCUPIED, TILE, Place

PALETTE = bytes.fromhex("f3f4f6ffffffbfdbc93741511d4ed8")
TRACK = OCCUPIED + 1
MAX_SIDE_TILES = 100
_EMPTY = bytes(TILE * TILE)


def map_png(
    tiles: dict[Place, bytes], track: list[list[float]], resolution_m: float | None
) -> bytes:
    """A picture of all tiles, y up; one white pixel when there are none."""
    known = {place: cells for place, cells in tiles.items() if cells != _EMPTY}
    if not known or resolution_m is None:
        return _png(1, [bytearray(b"\x01")])
    i0, i1 = min(i for i, _ in known), max(i for i, _ in known)
    j0, j1 = min(j for _, j in known), max(j for _, j in known)
    i1, j1 = min(i1, i0 + MAX_SIDE_TILES - 1), min(j1, j0 + MAX_SIDE_TILES - 1)
    width, height = (i1 - i0 + 1) * TILE, (j1 - j0 + 1) * TILE
    rows = []
    for j in range(j1, j0 - 1, -1):
        line = [known.get((i, j), _EMPTY) for i in range(i0, i1 + 1)]
        rows += [
            bytearray(b"".join(cells[y * TILE : (y + 1) * TILE] for cells in line))
            for y in range(TILE - 1, -1, -1)
        ]
    for x_m, y_m in track:
        x, y = int(x_m // resolution_m) - i0 * TILE, int(y_m // resolution_m) - j0 * TILE
        if 0 <= x < width and 0 <= y < height:
            rows[height - 1 - y][x] = TRACK
    return _png(width, rows)


def _png(width: int, rows: list[bytearray]) -> bytes:
    header = struct.pack(">IIBBBBB", width, len(rows), 8, 3, 0, 0, 0)
    data = zlib.compress(b"".join(b"\x00" + row for row in rows), 6)
    chunks = ((b"IHDR", header), (b"PLTE", PALETTE), (b"IDAT", data), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(*chunk) for chunk in chunks)


def _chunk(kind: bytes, data: bytes) -> bytes:
    check = zlib.crc32(kind + data)
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", check)
