"""The real brain, fed by a log of itself, gives the same commands to the last bit."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from pathlib import Path

import msgspec
import numpy as np
import pytest

from robot.body.replayed import replay
from robot.brain import Brain
from robot.config import Config, dump_config
from robot.geometry.se2 import SE2, exp
from robot.log.header import LogHeader
from robot.log.reader import read_commands
from robot.log.writer import LogWriter
from robot.messages import (
    Command,
    Contact,
    DriveCommand,
    Event,
    ImuSample,
    Landmark,
    LinkState,
    Planned,
    PlanOrder,
    Request,
    Scan,
    Seen,
    Tick,
    WheelTravel,
)
from robot.planning.worker import plan

TICK_NS = 20_000_000
SECONDS = 12
ROOM_M = 2.0  # half the side of a square room around the start


class Room:
    """A body in an empty square room: wheels do as they are told, walls are seen."""

    def __init__(self, config: Config) -> None:
        self._config = config
        self._rng = np.random.default_rng(11)
        self._pose, self._drive = SE2(), (0.0, 0.0)
        self._left_m = self._right_m = 0.0
        self._planned: list[tuple[int, Planned]] = []
        self._posts = self._rng.uniform(-ROOM_M, ROOM_M, (30, 2))
        self._signatures = [self._rng.bytes(32) for _ in self._posts]

    def events(self) -> Iterator[Event]:
        for k in range(1, SECONDS * 50):
            t_ns = k * TICK_NS
            v, w = self._drive
            self._pose = self._pose @ exp(0.02 * v, 0.0, 0.02 * w)
            half = 0.5 * self._config.robot.track_width_m
            self._left_m += 0.02 * (v - half * w)
            self._right_m += 0.02 * (v + half * w)
            yield WheelTravel(t_ns, t_ns + 1, self._left_m, self._right_m)
            yield ImuSample(t_ns, w + float(self._rng.normal(0.0, 0.01)))
            if k % 10 == 0:
                yield Contact(t_ns)
                yield LinkState(t_ns, True)
            if k == 50:
                yield Request(t_ns, "start")
            if k % 5 == 0:
                yield self._see(t_ns, k // 5)
            while self._planned and self._planned[0][0] <= t_ns:
                due_ns, answer = self._planned.pop(0)
                yield dataclasses.replace(answer, t_ns=due_ns)
            yield Tick(t_ns)

    def send(self, command: Command) -> None:
        if isinstance(command, DriveCommand):
            self._drive = command.v_mps, command.yaw_rate_radps
        elif isinstance(command, PlanOrder):
            answer = plan(command, self._config.planning, self._config.robot)
            self._planned.append((command.t_ns + 300_000_000, answer))

    def _see(self, t_ns: int, seq: int) -> Seen:
        local = self._pose.inverse().apply(self._posts)
        landmarks = []
        for i, (x, y) in enumerate(local):
            bearing = math.atan2(y, x)
            if abs(bearing) < 0.6 and math.hypot(x, y) > 0.3:
                near = math.hypot(x, y) + float(self._rng.normal(0.0, 0.01))
                cov = np.diag([1e-4, 1e-5])
                landmarks.append(Landmark(near, bearing, cov, self._signatures[i], track_id=i))
        bearings = np.linspace(-0.6, 0.6, 61)
        along = self._pose.yaw_rad + bearings
        with np.errstate(divide="ignore", invalid="ignore"):
            x_hit = (np.sign(np.cos(along)) * ROOM_M - self._pose.x_m) / np.cos(along)
            y_hit = (np.sign(np.sin(along)) * ROOM_M - self._pose.y_m) / np.sin(along)
        ranges = np.fmin(x_hit, y_hit)
        scan = Scan(bearings, ranges, np.minimum(ranges, 2.0))
        return Seen(t_ns - 5 * TICK_NS, t_ns, seq, tuple(landmarks), scan, 0.8)


@pytest.fixture(scope="module")
def log_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("brain") / "log.mcap"
    config = Config()
    room, brain = Room(config), Brain(config)
    with LogWriter(path, LogHeader(dump_config(config), seed=11)) as log:
        for event in room.events():
            log.event(event)
            for command in brain.on(event):
                log.command(command)
                room.send(command)
    return path


def test_the_brain_replays_identically(log_path: Path) -> None:
    result = replay(log_path)
    assert result.identical, result.sentence()
    assert result.events > SECONDS * 50 * 3
    assert result.commands > SECONDS * 50


def test_the_log_holds_a_drive_worth_replaying(log_path: Path) -> None:
    commands = list(read_commands(log_path))
    kinds = {type(command).__name__ for command in commands}
    assert {"DriveCommand", "PoseEstimate", "MapReport", "MissionState", "PlanOrder"} <= kinds
    assert max(abs(c.v_mps) for c in commands if isinstance(c, DriveCommand)) > 0.05


def test_another_configuration_differs(log_path: Path) -> None:
    slower = msgspec.structs.replace(Config().robot, cruise_mps=0.2)
    changed = msgspec.structs.replace(Config(), robot=slower)
    result = replay(log_path, make_brain=lambda config: Brain(changed))
    assert not result.identical and result.first_difference is not None
    assert "DriveCommand" in result.first_difference.sentence()
