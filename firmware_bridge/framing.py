"""Frames on a noisy line: COBS + CRC-32, incremental, never raising.

A frame is COBS(body + CRC-32 of the body, little-endian) followed by a zero byte; a zero appears
nowhere else, so after any noise the next zero puts the receiver back in step. COBS: Cheshire and
Baker, "Consistent Overhead Byte Stuffing", IEEE/ACM Transactions on Networking 7(2), 1999.
CRC: zlib's (reflected 0xEDB88320), because 16 bits let wrong orders through a torn cable.
"""

from __future__ import annotations

import zlib

from firmware_bridge.messages import MAX_BODY_BYTES

CRC_BYTES = 4
MAX_FRAME_BYTES = MAX_BODY_BYTES + CRC_BYTES + 1  # between two zeros; short enough for one block


def cobs_encode(data: bytes) -> bytes:
    """Replace every zero of `data`; the result holds none (and no delimiter)."""
    out = bytearray()
    for block in data.split(b"\0"):
        start = 0
        while len(block) - start >= 254:
            out += b"\xff" + block[start : start + 254]
            start += 254
        out.append(len(block) - start + 1)
        out += block[start:]
    return bytes(out)


def cobs_decode(data: bytes) -> bytes | None:
    """Undo `cobs_encode`; None when `data` is not the encoding of anything."""
    out = bytearray()
    at = 0
    while at < len(data):
        code = data[at]
        end = at + code
        if code == 0 or end > len(data):
            return None
        block = data[at + 1 : end]
        if 0 in block:
            return None
        out += block
        at = end
        if code != 0xFF and at < len(data):
            out.append(0)
    return bytes(out)


def encode_frame(body: bytes) -> bytes:
    """The bytes that travel for `body`, delimiter included."""
    return cobs_encode(body + zlib.crc32(body).to_bytes(CRC_BYTES, "little")) + b"\0"


class FrameDecoder:
    """Turns whatever arrives into bodies whose CRC is right, and counts the rest."""

    def __init__(self) -> None:
        self._piece = bytearray()
        self._too_long = False
        self.frames = 0
        self.crc_errors = 0
        self.framing_errors = 0

    def reset(self) -> None:
        """Forget an unfinished frame, for a fresh line; the counters stay."""
        self._piece.clear()
        self._too_long = False

    def feed(self, data: bytes) -> list[bytes]:
        """Bodies completed by `data`, in order."""
        bodies = []
        *ended, rest = data.split(b"\0")
        for piece in ended:
            self._append(piece)
            body = self._finish()
            if body is not None:
                bodies.append(body)
        self._append(rest)
        return bodies

    def _append(self, piece: bytes) -> None:
        if len(self._piece) + len(piece) > MAX_FRAME_BYTES:
            self._too_long = True
            self._piece.clear()
        elif not self._too_long:
            self._piece += piece

    def _finish(self) -> bytes | None:
        too_long, piece = self._too_long, bytes(self._piece)
        self.reset()
        if not piece and not too_long:
            return None  # zeros between frames mean nothing
        data = None if too_long else cobs_decode(piece)
        if data is None or len(data) <= CRC_BYTES:
            self.framing_errors += 1
            return None
        body, crc = data[:-CRC_BYTES], data[-CRC_BYTES:]
        if zlib.crc32(body).to_bytes(CRC_BYTES, "little") != crc:
            self.crc_errors += 1
            return None
        self.frames += 1
        return body
