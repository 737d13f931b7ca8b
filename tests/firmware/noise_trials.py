"""The whole bridge on a bad line: what stops, why, and how soon it is well again.

`python tests/firmware/noise_trials.py [--bytes N]` prints the table of PROTOCOL.md.
"""

from __future__ import annotations

import argparse
import random
import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from bridge_robot import HostBoard, Noise, Robot

from firmware_bridge.host import build_host_firmware
from robot.messages import ClearOrder

V_MPS = 0.2
RECOVERY_LIMIT_NS = 1_000_000_000
REST_TICKS = 15  # the motors here have no friction: their speed halves every 35 ms
Report = dict[str, float]


@dataclass
class Life:
    """A robot that drives straight on and, once stopped, is cleared and driven on."""

    robot: Robot
    stops: Counter[str] = field(default_factory=Counter)
    recoveries_ns: list[int] = field(default_factory=list)

    @property
    def bytes(self) -> int:
        """What the line has carried, both ways."""
        return self.robot.cable.bytes_sent + self.robot.cable.bytes_received

    def tick(self) -> None:
        """Drive on; nothing but the order, or a stop, may ever show at the wheels."""
        self.robot.tick(V_MPS)
        self.robot.events = self.robot.events[-50:]
        assert all(-0.01 <= speed <= V_MPS * 1.15 for speed in self.robot.speed)

    def drive_noisily(self, noise: Noise, until_bytes: int) -> None:
        """On a line with noise; a stop is counted by its reason and cleared at once."""
        self.robot.cable.noise = noise
        while self.bytes < until_bytes:
            self.tick()
            connected, reason = self.robot.link_state
            if connected and reason:
                self.stops[reason] += 1
                self._clear(100)

    def suffer(self, noise: Noise, ms: int) -> str:
        """Noise for so long, then a healed line; returns why it had stopped, or ''."""
        self.robot.cable.noise = noise
        for _ in range(0, ms, 20):
            self.tick()
        self.robot.cable.noise = Noise()
        healed_ns = self.robot.now_ns
        frames = self.robot.link.counters.frames
        # Some answers and telemetry must have come: only then is the latch known again.
        while not (self.robot.link_state[0] and self.robot.link.counters.frames > frames + 12):
            self.tick()
            assert self.robot.now_ns - healed_ns <= RECOVERY_LIMIT_NS
        reason = self.robot.link_state[1]
        resting_ns = 0
        if reason:
            resting_ns = self._rest()
            self.stops[reason] += 1
            self._clear(25)
        self.recoveries_ns.append(self.robot.now_ns - healed_ns - resting_ns)
        return reason

    def _rest(self) -> int:
        """Once stopped it comes to rest, whatever is ordered; how long that was waited for."""
        start_ns = self.robot.now_ns
        for _ in range(REST_TICKS):
            self.tick()
        assert max(map(abs, self.robot.speed)) < 0.005, self.robot.speed
        return self.robot.now_ns - start_ns

    def _clear(self, tries: int) -> None:
        for _ in range(tries):
            self.robot.wheels.send(ClearOrder(self.robot.now_ns, "test"))
            self.robot.run(2)
            if self.robot.link_state == (True, ""):
                return
        raise AssertionError(f"not cleared: {self.robot.link_state}, {self.robot.link.problem}")


def mixed(share: float, seed: int) -> Noise:
    """Flipped, dropped, doubled and inserted bytes in equal parts."""
    return Noise(random.Random(seed), *[share / 4] * 4)


def start(binary: Path) -> Life:
    """A robot that is driving."""
    life = Life(Robot(HostBoard(binary)))
    life.robot.arm()
    life.robot.run(25, V_MPS)
    return life


def at_share(binary: Path, share: float, total: int, seed: int = 1) -> Report:
    """Stops by their reason on a line with this share of hurt bytes."""
    life = start(binary)
    noise = mixed(share, seed)
    life.drive_noisily(noise, total)
    life.robot.close()
    return {"bytes": life.bytes, "hurt": noise.hurt, **life.stops}


def hopeless(binary: Path, share: float, total: int, seed: int = 1) -> Report:
    """Three seconds of such a line, then a healed one, over and over."""
    life = start(binary)
    noise = mixed(share, seed)
    rounds = 0
    while life.bytes < total:
        rounds += bool(life.suffer(noise, 3000))
        for _ in range(25):
            life.tick()
        assert life.robot.link_state == (True, "")
    life.robot.close()
    return {
        "bytes": life.bytes,
        "stopped rounds": rounds,
        "worst recovery ms": max(life.recoveries_ns) / 1e6,
        **life.stops,
    }


def bursts(binary: Path, count: int, seed: int = 1) -> Report:
    """Bursts of 50 ms to 2 s in which nothing but noise arrives."""
    life = start(binary)
    chance = random.Random(seed)
    for _ in range(count):
        life.suffer(Noise(chance, 0.6, 0.2, 0.1, 0.1), chance.randrange(50, 2001))
        for _ in range(chance.randrange(10, 60)):
            life.tick()
        assert life.robot.link_state == (True, "")
    life.robot.close()
    return {"bursts": count, "worst recovery ms": max(life.recoveries_ns) / 1e6, **life.stops}


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bytes", type=int, default=10**7, help="on each line (default: 10^7)")
    parser.add_argument("--bursts", type=int, default=1000)
    parser.add_argument("--row", choices=("0.1 %", "1 %", "5 %", "20 %", "bursts"))
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        binary = build_host_firmware(Path(folder))
        rows: list[tuple[str, Callable[[], Report]]] = [
            ("0.1 %", lambda: at_share(binary, 0.001, options.bytes)),
            ("1 %", lambda: at_share(binary, 0.01, options.bytes)),
            ("5 %", lambda: at_share(binary, 0.05, options.bytes)),
            ("20 %", lambda: hopeless(binary, 0.2, options.bytes)),
            ("bursts", lambda: bursts(binary, options.bursts)),
        ]
        for name, measure in rows:
            if options.row not in (None, name):
                continue
            report = ", ".join(f"{key} {value:.0f}" for key, value in measure().items())
            print(f"{name}: {report}", flush=True)


if __name__ == "__main__":
    main()
