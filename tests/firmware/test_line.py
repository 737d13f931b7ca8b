"""The controller's end of the line: what is no frame, and what happens when too much is said."""

from __future__ import annotations

import zlib

import pytest
from firmware_rig import SESSION, Rig

from firmware_bridge.codec import Packet, pack
from firmware_bridge.framing import cobs_encode, encode_frame
from firmware_bridge.messages import (
    MAX_BODY_BYTES,
    Ack,
    Drive,
    Hello,
    Result,
    Status,
    Stop,
    StopReason,
)

GO = pack(Packet(9, SESSION, Drive(200, 200, 50, 40, 400)))


def status_after(rig: Rig) -> Status:
    """What the controller has counted so far."""
    rig.step(10)
    rig.send(Hello(1))
    rig.step(210)
    return rig.heard(Status)[-1]


@pytest.mark.parametrize("size", [1, 2, 3])
def test_bodies_shorter_than_a_header_are_nothing(armed: Rig, size: int) -> None:
    armed.step(5)
    heard = len(armed.heard(Ack))
    armed.write(encode_frame(GO[:size]))
    armed.step(5)
    assert len(armed.heard(Ack)) == heard
    assert armed.still


@pytest.mark.parametrize("at", range(4))
@pytest.mark.parametrize("flip", [0x01, 0x80, 0xFF])
def test_every_byte_of_the_crc_counts(armed: Rig, at: int, flip: int) -> None:
    crc = bytearray(zlib.crc32(GO).to_bytes(4, "little"))
    crc[at] ^= flip
    armed.write(cobs_encode(GO + bytes(crc)) + b"\0")
    armed.step(5)
    assert armed.still
    assert status_after(armed).crc_errors == 1


def test_a_torn_block_is_no_frame(armed: Rig) -> None:
    """The last block promises more bytes than come; what did come has a right CRC."""
    frame = bytearray(encode_frame(b"\x02\x01\x01\x01" + bytes(range(1, 9))))
    frame[0] += 1
    armed.write(bytes(frame))
    status = status_after(armed)
    assert (status.framing_errors, status.crc_errors) == (1, 0)


@pytest.mark.parametrize("size", [MAX_BODY_BYTES + 1, MAX_BODY_BYTES + 2, 60, 200])
def test_a_frame_that_is_too_long_is_no_frame(armed: Rig, size: int) -> None:
    armed.write(encode_frame(GO + bytes(size - len(GO))))
    status = status_after(armed)
    assert (status.framing_errors, status.crc_errors) == (1, 0)
    assert armed.still


def test_the_longest_frame_is_one(armed: Rig) -> None:
    armed.write(encode_frame(GO + bytes(MAX_BODY_BYTES - len(GO))))
    armed.step(5)
    assert armed.heard(Ack)[-1].result == Result.UNKNOWN


def test_a_full_outbox_drops_whole_frames_and_says_so(armed: Rig) -> None:
    armed.step(5)
    before = len(armed.heard(Ack))
    for _ in range(60):
        armed.send(Stop())
    armed.step()
    answers = len(armed.heard(Ack)) - before
    assert 10 <= answers < 60
    assert (armed.decoder.crc_errors, armed.decoder.framing_errors) == (0, 0)
    status = status_after(armed)
    assert status.dropped == 60 - answers
    assert status.stop_reason == StopReason.HOST
