"""What every transport promises: one suite over a line in memory and a pseudo-terminal."""

from __future__ import annotations

import os
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Protocol

import pytest

from firmware_bridge.errors import BridgeError
from firmware_bridge.transport import SerialTransport, Transport, find_port, memory_pair


class Line(Protocol):
    """A transport and the far end of its line."""

    transport: Transport

    def far_write(self, data: bytes) -> None: ...

    def far_read(self, size: int) -> bytes: ...

    def tear(self) -> None: ...

    def mend(self) -> None: ...

    def done(self) -> None: ...


class MemoryLine:
    def __init__(self, _: Path) -> None:
        self.near, self.far = memory_pair()
        self.transport: Transport = self.near
        self.far.open()

    def far_write(self, data: bytes) -> None:
        self.far.write(data)

    def far_read(self, size: int) -> bytes:
        return self.far.read()

    def tear(self) -> None:
        self.near.unplug()

    def mend(self) -> None:
        self.near.plug()

    def done(self) -> None:
        self.near.close()


class PtyLine:
    """The port is a link to the terminal, so that it can come back under another name."""

    def __init__(self, folder: Path) -> None:
        self.name = folder / "port"
        self.master = -1
        self.mend()
        self.transport: Transport = SerialTransport(str(self.name))

    def far_write(self, data: bytes) -> None:
        os.write(self.master, data)

    def far_read(self, size: int) -> bytes:
        data = b""
        while len(data) < size:
            data += os.read(self.master, size - len(data))
        return data

    def tear(self) -> None:
        self.name.unlink()
        os.close(self.master)

    def mend(self) -> None:
        self.master, slave = os.openpty()
        tty.setraw(slave)
        self.name.symlink_to(os.ttyname(slave))
        os.close(slave)

    def done(self) -> None:
        self.transport.close()
        os.close(self.master)


@pytest.fixture(params=[MemoryLine, PtyLine], ids=["memory", "pty"])
def line(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Line]:
    """One kind of line after the other."""
    make: Callable[[Path], Line] = request.param
    made = make(tmp_path)
    yield made
    made.done()


def read(line: Line, size: int) -> bytes:
    """Poll until `size` bytes are here."""
    data, deadline_s = b"", time.monotonic() + 2.0
    while len(data) < size and time.monotonic() < deadline_s:
        data += line.transport.read()
    return data


def test_closed_until_opened(line: Line) -> None:
    assert not line.transport.is_open
    assert line.transport.problem
    assert not line.transport.write(b"lost")
    assert line.transport.read() == b""
    assert line.transport.open()
    assert line.transport.is_open
    assert line.transport.problem == ""
    assert line.transport.bytes_sent == 0


def test_bytes_pass_both_ways_and_are_counted(line: Line) -> None:
    everything = bytes(range(256))
    line.transport.open()
    assert line.transport.write(everything)
    assert line.far_read(256) == everything
    line.far_write(everything)
    assert read(line, 256) == everything
    assert (line.transport.bytes_sent, line.transport.bytes_received) == (256, 256)


def test_read_does_not_wait(line: Line) -> None:
    line.transport.open()
    start_s = time.monotonic()
    for _ in range(20):
        assert line.transport.read() == b""
    assert time.monotonic() - start_s < 0.2


def test_a_torn_line_closes_itself_and_opens_again(line: Line) -> None:
    for _ in range(3):
        assert line.transport.open()
        line.tear()
        assert line.transport.read() == b""
        assert not line.transport.write(b"lost")
        assert not line.transport.is_open
        assert not line.transport.open()
        assert line.transport.problem
        line.mend()
        assert line.transport.open()
        line.far_write(b"back")
        assert read(line, 4) == b"back"


def test_close_and_open_again(line: Line) -> None:
    line.transport.open()
    line.transport.close()
    assert not line.transport.is_open
    assert line.transport.open()
    assert line.transport.write(b"x")
    assert line.far_read(1) == b"x"


def test_a_full_line_drops_whole_chunks(tmp_path: Path) -> None:
    """Nobody reads: writes never block, and what does arrive is whole chunks in order."""
    line = PtyLine(tmp_path)
    line.transport.open()
    chunk = bytes(range(1, 101))
    taken = sum(line.transport.write(chunk) for _ in range(2000))
    assert 0 < taken < 2000
    received = b""
    os.set_blocking(line.master, False)
    deadline_s = time.monotonic() + 2.0
    while len(received) < taken * 100 and time.monotonic() < deadline_s:
        line.transport.write(b"")  # what was taken in part goes on its way
        try:
            received += os.read(line.master, 4096)
        except BlockingIOError:
            time.sleep(0.001)
    assert received == chunk * taken
    line.done()


def test_read_until_waits_for_what_was_promised(tmp_path: Path) -> None:
    line = PtyLine(tmp_path)
    transport = line.transport
    assert isinstance(transport, SerialTransport)
    transport.open()
    line.far_write(b"12345")
    transport.read_until(5)
    assert transport.read() == b"12345"
    line.tear()
    with pytest.raises(BridgeError, match="6 bytes were promised and 5 came"):
        transport.read_until(6)
    line.mend()
    line.done()


def test_a_missing_port_is_explained() -> None:
    transport = SerialTransport("/dev/no-such-port")
    assert not transport.open()
    assert "/dev/no-such-port does not exist" in transport.problem
    assert "link.port" in transport.problem


def test_a_file_is_no_port(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no terminal")
    transport = SerialTransport(str(tmp_path / "file"))
    assert not transport.open()
    assert "cannot be opened" in transport.problem


def test_two_programs_do_not_share_a_port(tmp_path: Path) -> None:
    line = PtyLine(tmp_path)
    assert line.transport.open()
    second = SerialTransport(str(line.name))
    assert not second.open()
    assert "cannot be opened" in second.problem
    line.done()


@pytest.mark.parametrize(
    ("names", "found"),
    [
        ([], "no motor controller was found"),
        (["usb-Some_Mouse-if00"], "no motor controller was found"),
        (["usb-1a86_USB_Serial-if00", "usb-Arduino_Nano-if00"], "several serial ports"),
    ],
)
def test_find_port_explains(
    names: list[str], found: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in names:
        (tmp_path / name).touch()
    monkeypatch.setattr("firmware_bridge.transport.BY_ID", tmp_path)
    monkeypatch.setattr("firmware_bridge.transport.UDEV_NAME", tmp_path / "none")
    with pytest.raises(BridgeError, match=found):
        find_port()


def test_find_port_by_usb_name_and_by_udev_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("firmware_bridge.transport.BY_ID", tmp_path)
    monkeypatch.setattr("firmware_bridge.transport.UDEV_NAME", tmp_path / "sweeper-wheels")
    (tmp_path / "usb-1a86_USB_Serial-if00").touch()
    assert find_port() == str(tmp_path / "usb-1a86_USB_Serial-if00")
    (tmp_path / "sweeper-wheels").touch()
    assert find_port() == str(tmp_path / "sweeper-wheels")
