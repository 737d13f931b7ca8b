"""The port is pulled out and comes back under another name; real terminals, simulated time."""

from __future__ import annotations

import contextlib
import os
import random
import tty
from pathlib import Path

import pytest
from bridge_robot import Cable, HostBoard, Robot

from firmware_bridge import transport
from firmware_bridge.transport import SerialTransport

MS = 1_000_000


class UsbCable(Cable):
    """A terminal of its own between link and controller, found by its USB name; the name leads to
    another terminal every time it is plugged in."""

    by_id: Path

    def __init__(self, inner: SerialTransport) -> None:
        super().__init__(inner)
        self.outer = SerialTransport()
        self.names: list[str] = []
        self.master = -1
        self.spare: list[tuple[int, int]] = []
        self.plug()

    def plug(self) -> None:
        """Plug it in, under a name that it has not had before."""
        self.master, slave = os.openpty()
        while os.ttyname(slave) in self.names[-1:]:
            self.spare.append((self.master, slave))  # the kernel would give the old name again
            self.master, slave = os.openpty()
        tty.setraw(slave)
        self.names.append(os.ttyname(slave))
        (self.by_id / "usb-1a86_USB_Serial-if00").symlink_to(self.names[-1])
        self.passed = self.outer.bytes_received
        self.sent = self.outer.bytes_sent
        os.close(slave)
        self.inner.read()

    def unplug(self) -> None:
        """Pull it out; what is under way is lost."""
        (self.by_id / "usb-1a86_USB_Serial-if00").unlink()
        os.close(self.master)
        self.master = -1
        for pair in self.spare:
            for end in pair:
                os.close(end)
        self.spare.clear()

    @property
    def is_open(self) -> bool:
        return self.outer.is_open

    @is_open.setter
    def is_open(self, _: bool) -> None:
        pass

    @property
    def problem(self) -> str:
        return self.outer.problem

    @problem.setter
    def problem(self, _: str) -> None:
        pass

    def open(self) -> bool:
        return self.outer.open()

    def close(self) -> None:
        self.outer.close()

    def read(self) -> bytes:
        if self.master < 0:
            return self.outer.read()
        data = self.inner.read()
        if data and self.outer.is_open:
            self.passed += os.write(self.master, data)
            self.outer.read_until(self.passed)
        return self.outer.read()

    def write(self, data: bytes) -> bool:
        taken = self.outer.write(data)
        while self.master >= 0 and self.sent < self.outer.bytes_sent:
            piece = os.read(self.master, self.outer.bytes_sent - self.sent)
            self.sent += len(piece)
            self.inner.write(piece)
        return taken


@pytest.mark.parametrize(
    "times", [10, pytest.param(100, marks=[pytest.mark.long, pytest.mark.timeout(3600)])]
)
def test_found_again_under_another_name(
    firmware_binary: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, times: int
) -> None:
    """Connected within 3 s; odometry neither lost nor counted twice."""
    monkeypatch.setattr(transport, "BY_ID", tmp_path)
    monkeypatch.setattr(transport, "UDEV_NAME", tmp_path / "none")
    monkeypatch.setattr(UsbCable, "by_id", tmp_path, raising=False)
    chance = random.Random(times)
    robot = Robot(HostBoard(firmware_binary), cable=UsbCable)
    cable = robot.cable
    assert isinstance(cable, UsbCable)
    waits_ms = []
    for _ in range(times):
        robot.arm()
        robot.run(chance.randrange(10, 60), chance.choice([0.2, -0.2, 0.4]))
        cable.unplug()
        robot.run(chance.randrange(1, 200), 0.2)
        assert max(map(abs, robot.speed)) < 0.5
        cable.plug()
        plugged_ns = robot.now_ns
        while not robot.link.connected:
            robot.tick(0.2)
            assert robot.now_ns - plugged_ns <= 3000 * MS
        waits_ms.append((robot.now_ns - plugged_ns) / MS)
        robot.run(20)
        assert robot.measured == pytest.approx(robot.travel, abs=0.0005)
    counters = robot.link.counters
    assert counters.sessions == times + 1
    assert all(before != after for before, after in zip(cable.names, cable.names[1:], strict=False))
    print(f"{times} times: reconnected within {max(waits_ms):.0f} ms")
    with contextlib.suppress(OSError):
        cable.unplug()
    robot.close()
