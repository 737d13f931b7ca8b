"""The console: captures, and a live line."""

from __future__ import annotations

import os
import threading
import tty
from pathlib import Path

import pytest

from firmware_bridge.codec import Packet, pack
from firmware_bridge.console import decode_capture, describe, main
from firmware_bridge.framing import encode_frame
from firmware_bridge.messages import (
    PROTOCOL_VERSION,
    Ack,
    Contacts,
    Drive,
    HelloAck,
    Wheels,
)

FRAME = encode_frame(pack(Packet(3, 9, Drive(100, -50, 20, 30, 200))))


def test_codes_are_words() -> None:
    assert "result=LATCHED stop_reason=CLIFF" in describe(Ack(1, 2, 2, 3, 4))
    assert describe(Contacts(5, 0b1000_0001)).endswith("bits=BUMP_LEFT|CHARGING")
    assert describe(Contacts(5, 0)).endswith("bits=none")
    assert "result=99" in describe(Ack(1, 2, 99, 0, 4))
    assert "build=0000abcd" in describe(HelloAck(0, 1, 1, 1, 0xABCD, 1, 1))
    assert describe(Wheels(1, -2, 3)) == "Wheels   time_us=1 left_ticks=-2 right_ticks=3"


def test_a_capture_is_decoded_around_its_damage() -> None:
    damaged = FRAME[:1] + b"\x7e" + FRAME[2:]
    unknown = encode_frame(b"\x63\x01\x00\x00")
    lines = list(decode_capture(b"\x02\0" + FRAME + damaged + unknown + FRAME))
    assert sum("Drive" in line and "left_mm_s=100" in line for line in lines) == 2
    assert lines[-1] == "3 frames, 1 unknown, 1 wrong CRC, 1 not a frame"


def test_command_line_on_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "capture").write_bytes(FRAME)
    assert main([str(tmp_path / "capture")]) == 0
    assert "session     9 seq   3  Drive" in capsys.readouterr().out


def test_a_missing_port_is_one_sentence(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["/dev/no-such-port"]) == 2
    assert "does not exist" in capsys.readouterr().err


def test_live_line_is_shown_and_recorded(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    master, slave = os.openpty()
    tty.setraw(slave)
    answer = encode_frame(pack(Packet(0, 0, HelloAck(0, PROTOCOL_VERSION + 1, 2, 1, 1, 1, 1))))
    said = bytearray()

    def controller() -> None:
        while len(said) < 20:
            said.extend(os.read(master, 100))
        os.write(master, answer)

    thread = threading.Thread(target=controller)
    thread.start()
    capture = tmp_path / "capture"
    assert main([os.ttyname(slave), "--seconds", "0.4", "--record", str(capture)]) == 0
    thread.join()
    out = capsys.readouterr().out
    assert "out Hello" in out
    assert "in  HelloAck" in out
    assert "flash the firmware" in out
    assert capture.read_bytes() == answer
    os.close(master)
    os.close(slave)
