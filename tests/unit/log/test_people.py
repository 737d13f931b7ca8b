"""What people see in a viewer: right topics, frames, rates and shapes, with complete schemas."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message_factory import GetMessageClass
from mcap.reader import make_reader

from robot.config import Config, LogConfig, dump_config
from robot.geometry.se2 import SE2
from robot.log import foxglove
from robot.log.header import LogHeader
from robot.log.people import Beat, PeopleChannels
from robot.log.writer import LogWriter
from robot.messages import (
    ClearOrder,
    Grid,
    MapReport,
    MissionState,
    Planned,
    PoseEstimate,
    Scan,
    Seen,
    StereoFrame,
    WheelTravel,
)
from robot.messages import (
    Path as Waypoints,
)

MS = 1_000_000
COV = np.eye(3) * 1e-4
CAMERA = Config().camera.stereo_camera()


def channels(**rates: float) -> tuple[PeopleChannels, list[tuple[str, Any]]]:
    shown: list[tuple[str, Any]] = []
    people = PeopleChannels(
        lambda topic, message, t_ns: shown.append((topic, message)),
        LogConfig(**rates),
        Config().robot,
        CAMERA,
    )
    return people, shown


def planar(translation: Any, rotation: Any) -> SE2:
    return SE2(translation.x, translation.y, 2.0 * math.atan2(rotation.z, rotation.w))


def test_a_beat_keeps_its_rate() -> None:
    for rate_hz, wanted in ((10.0, 100), (5.0, 50), (0.5, 5), (3.0, 30), (0.0, 0)):
        beat = Beat(rate_hz)
        times = [k * 100 * MS + (k % 3) * MS for k in range(100)]  # 10 Hz with jitter
        assert abs(sum(beat.due(t) for t in times) - wanted) <= 1
    beat = Beat(1.0)
    assert [beat.due(t * MS) for t in (0, 500, 9000, 9100, 10000)] == [1, 0, 1, 0, 1]


def test_the_transforms_compose_to_the_estimate() -> None:
    people, shown = channels()
    for k in range(50):
        people.event(WheelTravel(k * MS, k * MS, 0.010 * k, 0.012 * k), k * MS)
    pose = SE2(1.0, -2.0, 2.5)
    people.command(PoseEstimate(50 * MS, pose, COV, "ok"), 50 * MS)
    (_, tf), (topic, posed) = shown
    links = {(t.parent_frame_id, t.child_frame_id): t for t in tf.transforms}
    assert set(links) == {("map", "odom"), ("odom", "base_link"), ("base_link", "camera_left")}
    map_from_odom, odom_from_base = (
        planar(links[key].translation, links[key].rotation)
        for key in (("map", "odom"), ("odom", "base_link"))
    )
    composed = map_from_odom @ odom_from_base
    assert composed.distance_m(pose) < 1e-9 and composed.yaw_rad == pytest.approx(2.5)
    # Dead reckoning: the arc of both wheels.
    turn = 0.002 * 49 / Config().robot.track_width_m
    assert odom_from_base.yaw_rad == pytest.approx(turn)
    assert math.hypot(odom_from_base.x_m, odom_from_base.y_m) == pytest.approx(
        2 * 0.011 * 49 / turn * math.sin(turn / 2)
    )
    assert topic == "/pose" and planar(posed.pose.position, posed.pose.orientation).x_m == 1.0


def test_the_camera_looks_forward() -> None:
    q = foxglove.camera_transform(0, CAMERA.base_from_cam)
    x, y, z, w = q.rotation.x, q.rotation.y, q.rotation.z, q.rotation.w
    forward = [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]  # its z axis
    np.testing.assert_allclose(forward, [1, 0, 0], atol=1e-12)
    assert (q.translation.x, q.translation.y, q.translation.z) == pytest.approx((0.13, 0.03, 0.09))
    assert math.hypot(x, y, z, w) == pytest.approx(1.0) and w >= 0


def test_a_scan_becomes_a_uniform_fan() -> None:
    bearings = np.tan(np.linspace(-0.6, 0.6, 7))  # denser in the middle
    ranges = np.array([1.0, 2.0, 3.0, np.nan, 5.0, 6.0, 7.0])
    fan = foxglove.laser_scan(5, Scan(bearings, ranges, np.zeros(7)))
    assert fan.start_angle == bearings[0] and fan.end_angle == bearings[-1]
    assert len(fan.ranges) == 7 and fan.frame_id == "base_link"
    assert (fan.ranges[0], fan.ranges[6]) == (1.0, 7.0)
    assert math.isinf(fan.ranges[3])
    shown = np.linspace(bearings[0], bearings[-1], 7)
    for angle, value in zip(shown, fan.ranges, strict=True):
        nearest = ranges[np.abs(bearings - angle).argmin()]
        assert value == nearest or (math.isinf(value) and math.isnan(nearest))
    empty = foxglove.laser_scan(5, Scan(np.zeros(0), np.zeros(0), np.zeros(0)))
    assert len(empty.ranges) == 0
    one = foxglove.laser_scan(5, Scan(np.zeros(1), np.ones(1), np.zeros(1)))
    assert list(one.ranges) == [1.0]


def test_the_map_has_a_colour_for_each_meaning() -> None:
    grid = Grid(0.05, -1.0, 2.0, np.array([[-1, 0, 100], [0, 0, -1]], np.int8))
    covered = np.array([[False, True, False], [False, True, False]])
    message = foxglove.map_grid(0, grid, covered)
    cells = np.frombuffer(message.data, np.uint8).reshape(2, 3, 4)
    assert message.column_count == 3 and message.row_stride == 12 and message.cell_stride == 4
    assert (message.pose.position.x, message.pose.position.y) == (-1.0, 2.0)
    assert [field.name for field in message.fields] == ["red", "green", "blue", "alpha"]
    assert cells[0, 0, 3] == 0 and cells[0, 1, 3] == 255
    assert tuple(cells[0, 1]) == tuple(cells[1, 1]) != tuple(cells[1, 0])
    assert cells[0, 2, :3].max() < 80 < cells[1, 0, :3].min()


def test_landmarks_are_their_two_sigma_ellipses() -> None:
    yaw = 0.5
    turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
    cov = turn @ np.diag([0.3**2, 0.1**2]) @ turn.T
    nothing = Grid(0.1, 0, 0, np.zeros((1, 1), np.int8))
    places = np.array([[1.0, 2.0], [np.nan, 0.0]])
    report = MapReport(0, nothing, np.zeros((1, 1), bool), places, np.stack([cov, cov]))
    (entity,) = foxglove.landmark_scene(0, report).entities
    (disc,) = entity.cylinders
    assert (disc.pose.position.x, disc.pose.position.y) == (1.0, 2.0)
    assert (disc.size.x, disc.size.y) == pytest.approx((1.2, 0.4))
    seen_yaw = planar(disc.pose.position, disc.pose.orientation).yaw_rad
    assert math.sin(seen_yaw - yaw) == pytest.approx(0.0, abs=1e-9)


def test_the_mission_is_told_once_and_orders_always() -> None:
    people, shown = channels()
    for k in range(5):
        people.command(MissionState(k, "cleaning", "lane", float(k), 0.0), k)
    people.command(MissionState(6, "docking", "done", 6.0, 0.0), 6)
    people.command(ClearOrder(7, "button"), 7)
    assert [(topic, line.message) for topic, line in shown] == [
        ("/diagnostics", "cleaning: lane"),
        ("/diagnostics", "docking: done"),
        ("/diagnostics", "clear the stop: button"),
    ]


def test_a_rate_of_zero_shows_nothing() -> None:
    people, shown = channels(pose_hz=0.0, scan_hz=0.0, map_hz=0.0, landmarks_hz=0.0)
    one = np.zeros(1)
    people.event(Seen(0, 0, 0, (), Scan(one, one, one), 1.0), 0)
    people.command(PoseEstimate(0, SE2(), COV, "ok"), 0)
    people.truth(0, SE2())
    grid = Grid(0.1, 0, 0, np.zeros((1, 1), np.int8))
    people.command(MapReport(0, grid, grid.cells > 0, np.zeros((0, 2)), np.zeros((0, 2, 2))), 0)
    assert shown == []


def test_every_people_message_is_described_by_the_file_itself(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    grid = Grid(0.1, 0, 0, np.zeros((2, 2), np.int8))
    image = np.zeros((8, 8), np.uint8)
    with LogWriter(path, LogHeader(dump_config(Config()), CAMERA)) as log:
        three = np.linspace(-0.1, 0.1, 3)
        log.event(Seen(0, 0, 0, (), Scan(three, three, three), 1.0))
        log.event(Planned(0, 1, Waypoints(np.array([[0.0, 0], [1, 1], [1, 2]])), 0.0))
        log.command(PoseEstimate(0, SE2(), COV, "ok"))
        log.command(MissionState(0, "idle", "why", 0.0, 0.0))
        log.command(MapReport(0, grid, grid.cells > 0, np.ones((1, 2)), np.eye(2)[None]))
        log.truth(0, SE2())
        log.frame(StereoFrame(0, 0, image, image))
    seen = {}
    with open(path, "rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            if schema is None or schema.encoding != "protobuf":
                continue
            pool = DescriptorPool()
            for description in FileDescriptorSet.FromString(schema.data).file:
                pool.Add(description)
            kind = GetMessageClass(pool.FindMessageTypeByName(schema.name))
            seen[channel.topic] = kind.FromString(message.data)
    assert set(seen) == {
        "/scan", "/path", "/tf", "/pose", "/diagnostics", "/map", "/landmarks", "/truth",
        "/camera/left", "/camera/right", "/camera/left/calibration", "/camera/right/calibration",
    }  # fmt: skip
    assert seen["/path"].poses[0].orientation.z == pytest.approx(math.sin(math.pi / 8))
    assert seen["/path"].poses[2].orientation.z == pytest.approx(math.sin(math.pi / 4))
    assert seen["/camera/left"].format == "png" and seen["/camera/left"].frame_id == "camera_left"
    assert seen["/camera/right/calibration"].P[3] == pytest.approx(-228.0 * 0.06)
    assert seen["/camera/left/calibration"].P[3] == 0.0


def test_raw_frames_get_no_rectified_calibration(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    image = np.zeros((8, 8), np.uint8)
    with LogWriter(path, LogHeader(dump_config(Config()), CAMERA, calibration="raw")) as log:
        log.frame(StereoFrame(0, 0, image, image))
    with open(path, "rb") as file:
        topics = {channel.topic for _, channel, _ in make_reader(file).iter_messages()}
    assert topics == {"/camera/left", "/camera/right", "/frame/FrameStamp"}
