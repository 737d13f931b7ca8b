"""`python deploy/proof/kills.py`: kill -9 while the robot writes; every file stays whole.

A child writes as the runtime does, without a pause: the map with its previous generation, settings,
a calibration, and the ring of logs. After a random time it is killed. Then all of it is read by
those who read it at the next start: each must be what was written last or the one before, the
newest log must be readable up to the kill, and nothing may be refused. A power cut, which also
loses what the kernel still holds, is another trial: `tests/unit/deploy/test_power_cut.py`.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import random
import signal
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from robot.body.calibration.cameras import save
from robot.body.kept.store import HomeStore, write_whole
from robot.body.records.ring import LogRing
from robot.brain import Brain
from robot.calibrate.apply import set_keys
from robot.config import Config, dump_config, load_config
from robot.geometry.se2 import SE2
from robot.home import Home
from robot.log.header import LogHeader
from robot.log.reader import LogReader
from robot.mapping.grid import OccupancyGrid
from robot.messages import Scan, Tick, WheelTravel
from robot.perception.calibration import Eye, StereoCalibration
from robot.perception.calibration_files import parse_calibration

SEED = 7
STEP_M = 2e-5  # from one round to the next, in all lengths that are written
TICKS_PER_ROUND, SEGMENT_BYTES = 50, 20_000
MATRIX = np.array([[456.0, 0.0, 319.5], [0.0, 456.0, 239.5], [0.0, 0.0, 1.0]])


class Card:
    """The files of one robot; `write` and `check` know the same round by its number."""

    def __init__(self, folder: Path) -> None:
        self.store = HomeStore(folder / "home")
        self.settings, self.calibration = folder / "robot.toml", folder / "stereo.yaml"
        self.ring = folder / "ring"
        self._home = dataclasses.replace(Brain(Config()).home(), grid=seen_grid().memory())

    def write(self, number: int, log: LogRing) -> None:
        """One round: a second of log, then every file anew."""
        for k in range(TICKS_PER_ROUND):
            t_ns = (number * TICKS_PER_ROUND + k) * 20_000_000
            log.event(WheelTravel(t_ns, t_ns, float(number), 0.0))
            log.event(Tick(t_ns))
        log.flush()
        self.store.save(self.home(number))
        write_whole(self.settings, set_keys("", {"camera.z_m": metres(number)}).encode())
        pose = np.eye(4)
        pose[0, 3] = -metres(number)
        eye = Eye(640, 480, MATRIX, np.zeros(5))
        save(StereoCalibration(eye, eye, pose), self.calibration, "opencv", None)

    def home(self, number: int) -> Home:
        return dataclasses.replace(self._home, world_from_docked=SE2(float(number)))

    def check(self) -> dict[str, int]:
        """The round that each file is of. AssertionError or an error of ours when one is bad."""
        warnings: list[str] = []
        loaded = self.store.load(warnings.append)
        assert loaded is not None and loaded[1].world_from_docked is not None, "no map"
        assert not warnings, warnings[0]
        text = self.calibration.read_text()
        return {
            "map": round(loaded[1].world_from_docked.x_m),
            "settings": number_of(load_config(self.settings).camera.z_m),
            "calibration": number_of(parse_calibration(text, "stereo.yaml").baseline_m),
            "log": max((self._logged(path) for path in self.ring.glob("log-*.mcap")), default=0),
        }

    def _logged(self, path: Path) -> int:
        """The newest round in a log that may have been cut off; 0 when it was only just begun."""
        if path.stat().st_size == 0:
            return 0
        with LogReader(path) as log:
            events = (e for e in log.messages("event") if isinstance(e, WheelTravel))
            return max((round(event.left_m) for event in events), default=0)


def seen_grid() -> OccupancyGrid:
    """A map of eight metres by eight, all of it uneven."""
    grid, rng = OccupancyGrid(Config().mapping), np.random.default_rng(SEED)
    bearing_rad = np.linspace(-3.1, 3.1, 400)
    for x_m, y_m in np.ndindex(3, 3):
        range_m = rng.uniform(0.5, 2.5, len(bearing_rad))
        grid.integrate(SE2(2.0 * x_m, 2.0 * y_m), Scan(bearing_rad, range_m, range_m))
    return grid


def metres(number: int) -> float:
    """Another length for every round, within what a configuration allows."""
    return 0.05 + STEP_M * number


def number_of(length_m: float) -> int:
    return round((length_m - 0.05) / STEP_M)


def write_until_killed(card: Card, first: int, begun: Callable[[], None] = lambda: None) -> None:
    """Round after round; `begun` is told of the first."""
    header = LogHeader(config_toml=dump_config(Config()))
    log = LogRing(card.ring, header, segment_bytes=SEGMENT_BYTES, segments=4)
    number = first
    while True:
        card.write(number, log)
        if number == first:
            begun()
        number += 1


def killed(card: Card, first: int, after_s: float) -> None:
    """A child that writes, and is killed."""
    child = os.fork()
    if child == 0:
        try:
            write_until_killed(card, first)
        finally:
            os._exit(1)
    time.sleep(after_s)
    os.kill(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    assert os.WIFSIGNALED(status), "the writer ended by itself"


def compare(before: dict[str, int], now: dict[str, int]) -> None:
    """Rounds before a kill and after it; AssertionError where a file has gone back."""
    kept = {k: now[k] >= before.get(k, 0) for k in ("map", "settings", "calibration")}
    assert all(kept.values()), f"older than before: {kept}"
    begun = max(before.values(), default=0) + 1
    assert now["log"] >= now["map"] or now["map"] < begun, "the log ends before the map"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--kills", type=int, default=200)
    kills = parser.parse_args().kills
    wait = random.Random(SEED)
    with tempfile.TemporaryDirectory(dir=".") as folder:
        card = Card(Path(folder))
        log = LogRing(card.ring, LogHeader(config_toml=dump_config(Config())))
        card.write(0, log)
        log.close()
        before, caught = card.check(), 0
        for kill in range(kills):
            killed(card, max(before.values()) + 1, wait.uniform(0.02, 0.4))
            try:
                now = card.check()
                compare(before, now)
            except Exception as error:
                raise SystemExit(f"kill {kill + 1}: {type(error).__name__}: {error}") from None
            caught += len(set(now.values())) > 1
            before = now
    print(json.dumps({"kills": kills, "whole": kills, "amid_a_round": caught}))


if __name__ == "__main__":
    main()
