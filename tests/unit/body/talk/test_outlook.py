"""What watchers get to see, over a real socket, with the loop's side played by the test."""

import json
import socket
import time

import numpy as np
import pytest

from robot.body.talk import stream, watcher
from robot.body.talk.control import ControlSocket
from robot.body.talk.outlook import MAX_CRUMBS, Outlook, Track
from robot.body.talk.publisher import MAX_WATCHERS, Publisher
from robot.geometry.se2 import SE2
from robot.messages import (
    Battery,
    Grid,
    MapReport,
    MissionState,
    PoseEstimate,
    Seen,
    Tick,
)

NS = 1_000_000_000
OUTBOX_BYTES = 60_000


class Log:
    """An `EventLog` that counts."""

    def __init__(self):
        self.count = 0

    def event(self, event):
        self.count += 1

    command = event

    def flush(self):
        self.count += 1


class Floor:
    """A brain that shows whatever grid it was given."""

    def __init__(self):
        self.cells, self.asked = np.full((40, 50), -1, np.int8), 0

    def view(self):
        self.asked += 1
        return Grid(0.05, -0.5, 0.25, self.cells.copy()), np.zeros(self.cells.shape, bool)


class Watching:
    """The other end: reads frames until one fits."""

    def __init__(self, path):
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.connect(str(path))
        self.socket.sendall(b'{"verb": "watch"}\n')
        self.socket.settimeout(5)
        self.unframer, self.got = stream.Unframer(), []

    def until(self, fits):
        while True:
            for message in list(self.got):
                self.got.remove(message)
                if fits(*message):
                    return message[1]
            data = self.socket.recv(65536)
            assert data, "the robot hung up"
            self.got += self.unframer.feed(data)

    def json(self, type_):
        def fits(kind, payload):
            return kind == stream.JSON and json.loads(payload)["type"] == type_

        return json.loads(self.until(fits))


@pytest.fixture
def robot(tmp_path):
    class Robot:
        brain, log, looked = Floor(), Log(), None
        path = tmp_path / "control.sock"

        def __init__(self):
            self.outlook = Outlook(self.log, self.brain, "sim", 0.17)
            self.publisher = Publisher(self.outlook, lambda: self.looked, lambda: [{"code": "a"}])
            self.control = ControlSocket(self.path, self.publisher.adopt)
            self.publisher.start()

        def watching(self):
            watching = Watching(self.path)
            for _ in range(3):
                self.control.poll(0)
            return watching

    robot = Robot()
    yield robot
    robot.publisher.stop()
    robot.control.close()


def pose(t_ns, x_m, y_m=0.0):
    return PoseEstimate(t_ns, SE2(x_m, y_m, 0.5), np.diag([1e-4, 4e-4, 1e-3]), "ok")


def test_a_watcher_is_greeted_and_told_the_state_at_once(robot):
    watching = robot.watching()
    hello = watching.json("hello")
    assert hello["protocol"] == 1 and "dock" in hello["verbs"] and hello["eyes"] == []
    robot.outlook.event(Battery(0, 14.8, 71.5))
    robot.outlook.command(MissionState(5 * NS, "clean", "start was requested", 1.5, float("nan")))
    status = watching.json("status")
    assert status["state"] == "clean" and status["battery_pct"] == 71.5
    assert status["covered_m2"] == 1.5 and status["remaining_m2"] is None
    late = robot.watching()
    assert late.json("status")["reason"] == "start was requested"


def test_the_map_travels_as_changes_and_arrives_whole(robot):
    watching = robot.watching()
    watching.json("hello")
    robot.brain.cells[5:20, 5:40] = 0
    robot.outlook.event(Tick(NS))
    assert watching.json("map")["resolution_m"] == 0.05
    whole = stream.unpack_tiles(watching.until(lambda kind, _: kind == stream.TILES))
    robot.brain.cells[6, 6] = 100
    robot.outlook.event(Tick(2 * NS))
    change = stream.unpack_tiles(watching.until(lambda kind, _: kind == stream.TILES))
    assert len(change) == 1 and len(whole) > 1
    late = robot.watching()
    again = stream.unpack_tiles(late.until(lambda kind, _: kind == stream.TILES))
    assert again == whole | change


def test_the_map_is_not_even_looked_at_while_nobody_watches(robot):
    for second in range(5):
        robot.outlook.event(Tick(second * NS))
    assert robot.brain.asked == 0 and robot.log.count == 5


def test_the_track_comes_whole_and_begins_anew_with_a_run(robot):
    robot.outlook.command(MissionState(0, "clean", "", 0.0, 0.0))
    for step in range(10):
        robot.outlook.command(pose(step * NS, 0.1 * step))
    watching = robot.watching()
    track = watching.json("track")
    assert track["first"] == 0 and len(track["xy_m"]) == 10
    robot.outlook.command(pose(20 * NS, 2.0))
    assert watching.json("track") == {**track, "first": 10, "xy_m": [[2.0, 0.0]]}
    robot.outlook.command(MissionState(21 * NS, "done", "", 0.0, 0.0))
    robot.outlook.command(MissionState(22 * NS, "undock", "", 0.0, 0.0))
    robot.outlook.command(pose(23 * NS, 0.0))
    while (new := watching.json("track"))["number"] == track["number"]:
        pass
    assert new["first"] == 0 and len(new["xy_m"]) <= 1


def test_an_endless_track_is_thinned_out():
    track = Track()
    for step in range(MAX_CRUMBS + 1):
        track.add(step * 0.05, 0.0)
    assert len(track.points) < MAX_CRUMBS * 0.51 and track.number == 1


def test_pose_and_landmarks_carry_their_uncertainty(robot):
    watching = robot.watching()
    watching.json("hello")
    robot.outlook.command(pose(NS, 1.25))
    assert watching.json("pose")["cov"] == [1e-4, 0.0, 4e-4, 1e-3]
    cov = np.array([[[0.01, 0.002], [0.002, 0.03]], [[np.nan, 0], [0, 1]]])
    grid, covered = robot.brain.view()
    report = MapReport(NS, grid, covered, np.array([[1.0, 2.0], [3.0, 4.0]]), cov)
    robot.outlook.command(report)
    assert watching.json("landmarks")["points"] == [[1.0, 2.0, 0.01, 0.002, 0.03]]


def test_pictures_are_made_only_for_who_asks(robot):
    watching = robot.watching()
    grey = np.full((24, 32), 90, np.uint8)
    robot.looked = (grey, np.full((24, 32), np.nan, np.float32))
    robot.outlook.event(Tick(NS))
    watching.json("status")
    time.sleep(0.5)
    assert not [m for m in watching.got if m[0] == stream.IMAGE]
    watching.socket.sendall(b'{"look": ["left"]}\n')
    image = watching.until(lambda kind, _: kind == stream.IMAGE)
    assert image[:1] == b"\x00" and image[1:3] == b"\xff\xd8"


def test_checks_are_answered_to_who_asks(robot):
    watching = robot.watching()
    watching.socket.sendall(b'{"check": true}\n')
    assert watching.json("check")["checks"] == [{"code": "a"}]


def test_who_does_not_read_is_dropped_and_the_others_go_on(robot, monkeypatch):
    monkeypatch.setattr(watcher, "MAX_OUTBOX_BYTES", OUTBOX_BYTES)
    slow, quick = robot.watching(), robot.watching()
    quick.json("hello")
    rng = np.random.default_rng(3)
    robot.brain.cells = np.zeros((300, 300), np.int8)
    deadline = time.monotonic() + 20
    second = 0
    while len(robot.publisher._watchers) == 2 and time.monotonic() < deadline:
        second += 1
        robot.brain.cells = rng.choice(np.array([0, 100], np.int8), (300, 300))
        robot.outlook.event(Tick(second * NS))
        quick.until(lambda kind, _: kind == stream.TILES)
    assert len(robot.publisher._watchers) == 1
    robot.outlook.command(MissionState(second * NS, "done", "read on", 0.0, 0.0))
    while quick.json("status")["reason"] != "read on":
        pass
    slow.socket.settimeout(2)
    received = 0
    while data := slow.socket.recv(1 << 16):
        received += len(data)
    assert received < 400_000 + OUTBOX_BYTES  # what the system holds, and the outbox


def test_there_is_a_limit_to_watchers_and_nonsense_is_hung_up_on(robot):
    crowd = [robot.watching() for _ in range(MAX_WATCHERS)]
    for watching in crowd:
        watching.json("hello")
    refused = robot.watching()
    assert b'"accepted": false' in refused.socket.recv(4096)
    crowd[0].socket.sendall(b"[1]\n")
    with pytest.raises(AssertionError, match="hung up"):
        crowd[0].until(lambda *_: False)


def test_stage_times_are_smoothed(robot):
    watching = robot.watching()
    for frame in range(50):
        robot.outlook.event(Seen(frame, frame, frame, (), None, 1.0, stage_ms={"scan": 4.0}))
    robot.outlook.event(Tick(NS))
    while "scan" not in (status := watching.json("status"))["stage_ms"]:
        robot.outlook.event(Tick(status and 3 * NS))
    assert status["stage_ms"]["scan"] == 4.0


def test_only_what_somebody_answers_is_offered():
    outlook = Outlook(Log(), Floor(), "sim", 0.17)
    assert {"start", "rooms", "schedule list"} <= set(outlook.hello["verbs"])
    outlook.offer("mission", "map")
    assert "rooms" in outlook.hello["verbs"] and "schedule list" not in outlook.hello["verbs"]
    assert {verb["place"] for verb in outlook.hello["commands"]} == {"mission", "map"}
