"""The host process is killed or stopped at random moments while it drives, in real time."""

from __future__ import annotations

import contextlib
import os
import random
import signal
import subprocess
import sys
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from firmware_rig import Rig, emulated_rig

from firmware_bridge.messages import StopReason

HOST = Path(__file__).with_name("driving_host.py")
STEP_MS = 4
REST_MS = 150
START_S = 20.0


class TooBusy(Exception):
    """This computer did not let the host say its orders in time: no trial."""


class Bench:
    """A controller with motors, paced by the clock, and a terminal for a host process."""

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        rig.friction_mps2 = 0.1 * 0.6 / rig.lag_s
        self.master, self.slave = os.openpty()
        tty.setraw(self.slave)
        os.set_blocking(self.master, False)
        rig.forward = self._to_host
        self.last_byte_us = 0
        self.next_s = time.monotonic()

    def close(self) -> None:
        """Let go of the terminal."""
        os.close(self.master)
        os.close(self.slave)

    def _to_host(self, data: bytes) -> None:
        with contextlib.suppress(BlockingIOError):  # a stopped host lets its line fill up
            os.write(self.master, data)

    def live(self, done: Callable[[], bool], limit_s: float) -> None:
        """Let both live until `done`."""
        self.next_s = time.monotonic()
        end_us = self.rig.time_us + round(limit_s * 1e6)
        while not done():
            assert self.rig.time_us < end_us, "it takes too long"
            with contextlib.suppress(BlockingIOError):
                self.rig.write(os.read(self.master, 4096))
                self.last_byte_us = self.rig.time_us
            self.rig.step(STEP_MS)
            self.next_s += STEP_MS / 1000
            time.sleep(max(0.0, self.next_s - time.monotonic()))

    def pass_time(self, seconds: float) -> None:
        """Let both live for so long."""
        end_us = self.rig.time_us + round(seconds * 1e6)
        self.live(lambda: self.rig.time_us >= end_us, seconds + 1.0)

    def latch_number(self) -> int:
        """Of the last stop; 1 is the reset's."""
        return self.rig.latch[1] if self.rig.packets else 1

    def at_rest(self) -> bool:
        """Whether the wheels stand still."""
        return self.rig.speed_mps == [0.0, 0.0]


@contextlib.contextmanager
def host(bench: Bench, valid_for_ms: int, speed: int) -> Iterator[subprocess.Popen[bytes]]:
    """A host that has made the wheels turn. Raises TooBusy when an order of it ran out before."""
    known = bench.latch_number()
    arguments = [os.ttyname(bench.slave), str(speed), str(speed), str(valid_for_ms)]
    process = subprocess.Popen([sys.executable, str(HOST), *arguments])
    try:
        bench.live(lambda: min(bench.rig.speed_mps) > 0.1 or bench.latch_number() > known, START_S)
        if bench.latch_number() > known:
            raise TooBusy
        yield process
    finally:
        process.kill()
        process.wait()


def trial(bench: Bench, chance: random.Random, way: signal.Signals) -> float | None:
    """Kill or stop the host; milliseconds from its last order's end to wheels at rest.

    None when this computer was too busy to let the host drive until then.
    """
    valid_for_ms = chance.choice([150, 200, 300])
    with host(bench, valid_for_ms, chance.choice([200, 300, 400])) as process:
        bench.pass_time(chance.uniform(0.0, 0.4))
        if bench.at_rest():
            return None
        process.send_signal(way)
        bench.live(bench.at_rest, 2.0)
        waited_ms = (bench.rig.time_us - bench.last_byte_us) / 1000
        assert waited_ms <= valid_for_ms + REST_MS + STEP_MS
        if way == signal.SIGSTOP:
            bench.pass_time(chance.choice([0.0, 0.8]))
            process.send_signal(signal.SIGCONT)
            bench.pass_time(0.4)
            assert bench.at_rest(), "it drove on by itself"
            assert bench.rig.latch[0] in (StopReason.EXPIRED, StopReason.LINK_LOST)
    bench.pass_time(0.05)
    return waited_ms - valid_for_ms


def trials(rig: Rig, count: int) -> None:
    """All of them must end in time; prints the slowest."""
    chance = random.Random(count)
    bench = Bench(rig)
    ways = [signal.SIGKILL, signal.SIGSTOP]
    rests_ms: list[float] = []
    for _ in range(3 * count):
        del rig.packets[:-1000]
        with contextlib.suppress(TooBusy):
            rest_ms = trial(bench, chance, ways[len(rests_ms) % 2])
            rests_ms += [] if rest_ms is None else [rest_ms]
        if len(rests_ms) == count:
            break
    bench.close()
    assert len(rests_ms) == count, "this computer is too busy"
    worst_ms = max(rests_ms)
    print(f"{count} of {count}: at rest at most {worst_ms:.0f} ms after the last order's end")


@pytest.mark.parametrize(
    "count", [4, pytest.param(200, marks=[pytest.mark.long, pytest.mark.timeout(3600)])]
)
def test_a_host_that_is_gone_stops_the_wheels(rig: Rig, count: int) -> None:
    trials(rig, count)


def test_also_on_the_emulated_board(emulated_board: tuple[Path, Path]) -> None:
    with emulated_rig(emulated_board) as rig:
        trials(rig, 2)
