"""Known encodings and what the decoder does with noise."""

from __future__ import annotations

import pytest

from firmware_bridge.framing import (
    MAX_FRAME_BYTES,
    FrameDecoder,
    cobs_decode,
    cobs_encode,
    encode_frame,
)


@pytest.mark.parametrize(
    ("data", "encoded"),
    [
        (b"", b"\x01"),
        (b"\x00", b"\x01\x01"),
        (b"\x00\x00", b"\x01\x01\x01"),
        (b"\x11\x22\x00\x33", b"\x03\x11\x22\x02\x33"),
        (b"\x11\x00\x00\x00", b"\x02\x11\x01\x01\x01"),
        (bytes(range(1, 255)), b"\xff" + bytes(range(1, 255)) + b"\x01"),
        (b"\x00" + bytes(range(1, 255)), b"\x01\xff" + bytes(range(1, 255)) + b"\x01"),
    ],
)
def test_cobs_of_the_paper(data: bytes, encoded: bytes) -> None:
    assert cobs_encode(data) == encoded
    assert cobs_decode(encoded) == data


@pytest.mark.parametrize("wrong", [b"\x03\x11", b"\x02\x00", b"\x00", b"\x05\x01\x02\x03"])
def test_cobs_refuses_what_it_never_writes(wrong: bytes) -> None:
    assert cobs_decode(wrong) is None


def test_a_frame_is_cobs_of_body_and_zlib_crc() -> None:
    assert encode_frame(b"123456789") == b"\x0e123456789\x26\x39\xf4\xcb\x00"


def test_counts_what_is_wrong_and_goes_on() -> None:
    decoder = FrameDecoder()
    good = encode_frame(b"hello")
    flipped = good[:3] + bytes([good[3] ^ 1]) + good[4:]
    assert decoder.feed(flipped + good) == [b"hello"]
    assert decoder.feed(b"\x09\x01\x00" + good) == [b"hello"]
    assert decoder.feed(b"\x01\x00" + good) == [b"hello"]  # shorter than a CRC
    assert (decoder.frames, decoder.crc_errors, decoder.framing_errors) == (3, 1, 2)


def test_zeros_between_frames_mean_nothing() -> None:
    decoder = FrameDecoder()
    assert decoder.feed(b"\0\0\0" + encode_frame(b"a") + b"\0\0") == [b"a"]
    assert decoder.framing_errors == decoder.crc_errors == 0


def test_an_endless_piece_is_one_error_and_takes_no_memory() -> None:
    decoder = FrameDecoder()
    for _ in range(100):
        assert decoder.feed(b"\x55" * 1000) == []
    assert len(decoder._piece) <= MAX_FRAME_BYTES
    assert decoder.feed(b"\0" + encode_frame(b"a")) == [b"a"]
    assert decoder.framing_errors == 1
