"""Read the line as people do: `python -m firmware_bridge.console PORT|FILE`.

A file is a capture of raw bytes, of either direction. A port is spoken to: the console opens a
session and keeps it, but never orders anything, so the controller stays stopped.
"""

from __future__ import annotations

import argparse
import contextlib
import stat
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import fields
from pathlib import Path
from typing import BinaryIO, Literal

from firmware_bridge.codec import Packet, unpack
from firmware_bridge.counting import LinkCounters
from firmware_bridge.errors import BridgeError
from firmware_bridge.framing import FrameDecoder
from firmware_bridge.link import Link
from firmware_bridge.messages import (
    Ack,
    ContactBit,
    Contacts,
    HelloAck,
    Message,
    Result,
    State,
    Status,
    StopReason,
)
from firmware_bridge.transport import SerialTransport

POLL_S = 0.01
_NAMED = {"stop_reason": StopReason, "result": Result, "state": State}


def describe(message: Message) -> str:
    """One line: the message's name and fields, codes in words."""
    parts = [type(message).__name__.ljust(8)]
    for field in fields(message):
        value = getattr(message, field.name)
        enum = _NAMED.get(field.name) if isinstance(message, Ack | HelloAck | Status) else None
        if enum is not None and value in enum._value2member_map_:
            text = enum(value).name
        elif isinstance(message, Contacts) and field.name == "bits":
            text = "|".join(bit.name or "" for bit in ContactBit if bit & value) or "none"
        elif field.name == "build":
            text = f"{value:08x}"
        else:
            text = str(value)
        parts.append(f"{field.name}={text}")
    return " ".join(parts)


def decode_capture(data: bytes) -> Iterator[str]:
    """A line for every frame of a capture, and a last one with what was not a frame."""
    decoder, unknown = FrameDecoder(), 0
    for body in decoder.feed(data):
        packet = unpack(body)
        if packet is None:
            unknown += 1
            yield f"unknown  {body.hex(' ')}"
        else:
            yield f"session {packet.session:5d} seq {packet.seq:3d}  {describe(packet.message)}"
    yield (
        f"{decoder.frames} frames, {unknown} unknown, {decoder.crc_errors} wrong CRC, "
        f"{decoder.framing_errors} not a frame"
    )


class _Recording(SerialTransport):
    """A port whose incoming bytes are kept in a file too."""

    def __init__(self, port: str, baud: int, file: BinaryIO) -> None:
        super().__init__(port, baud)
        self._file = file

    def read(self) -> bytes:
        data = super().read()
        self._file.write(data)
        return data


def monitor(
    transport: SerialTransport, show: Callable[[str], None], until: Callable[[], bool]
) -> LinkCounters:
    """Print everything on the line until `until()`; says so when there is no session."""
    start_ns = time.monotonic_ns()

    def tap(way: Literal["out", "in"], packet: Packet) -> None:
        seconds = (time.monotonic_ns() - start_ns) * 1e-9
        show(f"{seconds:9.3f} {way:3s} {describe(packet.message)}")

    link, said = Link(transport, tap=tap), ""
    while not until():
        link.poll(time.monotonic_ns())
        if link.problem != said:
            said = link.problem
            if said:
                show(said)
        time.sleep(POLL_S)
    return link.counters


def monitor_port(
    port: str,
    baud: int,
    show: Callable[[str], None],
    until: Callable[[], bool],
    record: Path | None = None,
) -> LinkCounters:
    """Monitor a serial port ('' finds it) and keep its incoming bytes in a file, if one is named.

    Returns what the link has counted. Raises BridgeError when the port cannot be opened.
    """
    with contextlib.ExitStack() as stack:
        transport = SerialTransport(port, baud)
        if record is not None:
            transport = _Recording(port, baud, stack.enter_context(record.open("wb")))
        if not transport.open():
            raise BridgeError(transport.problem)
        stack.callback(transport.close)
        return monitor(transport, show, until)


def _is_port(source: Path) -> bool:
    return not source.exists() or stat.S_ISCHR(source.stat().st_mode)


def main(arguments: list[str] | None = None) -> int:
    """Command line; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m firmware_bridge.console", description=__doc__)
    parser.add_argument("source", type=Path, help="a serial port, or a file with captured bytes")
    parser.add_argument("--baud", type=int, default=115200)
    parser.add_argument("--seconds", type=float, default=float("inf"), help="stop after this long")
    parser.add_argument("--record", type=Path, help="keep the port's incoming bytes in this file")
    options = parser.parse_args(arguments)
    try:
        if not _is_port(options.source):
            for line in decode_capture(options.source.read_bytes()):
                print(line)
            return 0
        end_s = time.monotonic() + options.seconds
        port = str(options.source)
        monitor_port(port, options.baud, print, lambda: time.monotonic() >= end_s, options.record)
        return 0
    except (BridgeError, OSError) as error:
        print(error, file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 0


if __name__ == "__main__":
    sys.exit(main())
