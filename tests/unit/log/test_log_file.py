"""A log on disk: what goes in comes out, and a cut or damaged one says so in a sentence."""

from __future__ import annotations

import math
import threading
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from robot.config import Config, LogConfig, dump_config
from robot.errors import LogError
from robot.geometry.se2 import SE2
from robot.log.codec import encode
from robot.log.header import LogHeader
from robot.log.reader import (
    LogReader,
    read_commands,
    read_events,
    read_frames,
    read_header,
    read_truth,
)
from robot.log.recover import recover
from robot.log.writer import LogWriter
from robot.messages import (
    Command,
    Contact,
    DriveCommand,
    Event,
    Grid,
    ImuSample,
    Landmark,
    MapReport,
    MissionState,
    Planned,
    PoseEstimate,
    Request,
    Scan,
    Seen,
    StereoFrame,
    StopOrder,
    Tick,
    WheelTravel,
)
from robot.messages import (
    Path as Waypoints,
)

MS = 1_000_000


def header(**changes: object) -> LogHeader:
    config = Config()
    fields = {
        "config_toml": dump_config(config),
        "camera": config.camera.stereo_camera(),
        "scene": "flat",
        "seed": 3,
        "body": "sim",
        "wall_time": "2000-01-01T00:00:00Z",
        "extra": {"model_sha256": "abc"},
    }
    return LogHeader(**{**fields, **changes})  # type: ignore[arg-type]


def life(ticks: int) -> list[tuple[Event, list[Command]]]:
    """Events and the commands that answer them, with every arm of the writer used."""
    rng = np.random.default_rng(1)
    result: list[tuple[Event, list[Command]]] = [(Request(0, "start", ("now",)), [])]
    for k in range(1, ticks + 1):
        t = k * 20 * MS
        result += [
            (WheelTravel(t, t + MS, k * 0.004, k * 0.005), []),
            (ImuSample(t, float(rng.normal())), []),
            (Contact(t, bump_left=k == 3), [StopOrder(t, "bumped")] if k == 3 else []),
        ]
        if k % 5 == 0:
            landmark = Landmark(1.0, 0.1 * k, np.eye(2) * 0.01, rng.bytes(32))
            scan = Scan(np.array([-0.5, 0.0, 0.3]), np.array([1.0, math.nan, 2.0]), np.zeros(3))
            seen = Seen(t - 100 * MS, t, k // 5, (landmark,), scan, 0.5, stage_ms={"depth": 9.0})
            pose = PoseEstimate(t, SE2(0.1 * k, 0.0, 0.02), np.eye(3) * 1e-4, "ok")
            result.append((seen, [pose]))
        commands: list[Command] = [DriveCommand(t, 0.2, float(rng.normal()), 1, 0, 200, "follow")]
        if k % 50 == 0:
            grid = Grid(0.1, -1.0, -2.0, np.array([[0, 100, -1], [0, 0, 0]], np.int8))
            covered = np.array([[True, False, False], [False, True, False]])
            commands += [
                MapReport(t, grid, covered, np.array([[1.0, 2.0]]), np.eye(2)[None] * 0.01),
                MissionState(t, "cleaning", f"lane {k}", 1.0, 2.0),
            ]
            result.append((Planned(t, 1, Waypoints(np.array([[0.0, 0.0], [1.0, 1.0]])), 2.0), []))
        result.append((Tick(t), commands))
    return result


def write(path: Path, story: list[tuple[Event, list[Command]]], chunk_bytes: int = 4096) -> None:
    with LogWriter(path, header(), LogConfig(chunk_bytes=chunk_bytes)) as log:
        for event, commands in story:
            log.event(event)
            for command in commands:
                log.command(command)
            log.truth(event.t_ns, SE2(event.t_ns * 1e-9, 0.0, 0.0))


@pytest.fixture(scope="module")
def story() -> list[tuple[Event, list[Command]]]:
    return life(200)


@pytest.fixture(scope="module")
def log_path(
    tmp_path_factory: pytest.TempPathFactory, story: list[tuple[Event, list[Command]]]
) -> Path:
    path = tmp_path_factory.mktemp("log") / "log.mcap"
    write(path, story)
    return path


def texts(messages: object) -> list[bytes]:
    return [encode(message) for message in messages]  # type: ignore[attr-defined]


def test_events_and_commands_come_back_in_order(
    log_path: Path, story: list[tuple[Event, list[Command]]]
) -> None:
    assert texts(read_events(log_path)) == texts(event for event, _ in story)
    assert texts(read_commands(log_path)) == texts(c for _, answers in story for c in answers)
    truth = list(read_truth(log_path))
    assert truth[-1] == (story[-1][0].t_ns, SE2(story[-1][0].t_ns * 1e-9, 0.0, 0.0))


def test_a_command_carries_the_number_of_its_event(
    log_path: Path, story: list[tuple[Event, list[Command]]]
) -> None:
    with LogReader(log_path) as log:
        got = [(entry.number, entry.text) for entry in log.entries(("command",))]
        assert log.ending == "complete"
    wanted = [
        (number, encode(command))
        for number, (_, answers) in enumerate(story, start=1)
        for command in answers
    ]
    assert got == wanted


def test_the_header_comes_back(log_path: Path) -> None:
    got, wanted = read_header(log_path), header()
    assert got.config() == Config()
    assert encode(got.camera) == encode(wanted.camera)
    for name in ("config_toml", "scene", "seed", "body", "wall_time", "software", "extra"):
        assert getattr(got, name) == getattr(wanted, name)


def test_any_mcap_reader_finds_foxglove_schemas(log_path: Path) -> None:
    with open(log_path, "rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        topics = {c.topic: summary.schemas[c.schema_id].name for c in summary.channels.values()}
        assert topics["/tf"] == "foxglove.FrameTransforms"
        assert topics["/scan"] == "foxglove.LaserScan"
        assert topics["/map"] == "foxglove.Grid"
        assert topics["/landmarks"] == "foxglove.SceneUpdate"
        assert topics["/pose"] == topics["/truth"] == "foxglove.PoseInFrame"
        assert topics["/path"] == "foxglove.PosesInFrame"
        assert topics["/diagnostics"] == "foxglove.Log"
        assert topics["/event/Seen"] == "sweeper.Seen"
        assert len(list(reader.iter_messages(topics=["/command/DriveCommand"]))) == 200


def test_frames_come_back_pixel_for_pixel(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    path = tmp_path / "frames.mcap"
    frames = [
        StereoFrame(k * MS, k, *rng.integers(0, 256, (2, 24, 32), np.uint8), yaw_change_rad=yaw)
        for k, yaw in enumerate([math.nan, 0.125, -0.5])
    ]
    with LogWriter(path, header()) as log:
        for frame in frames:
            log.frame(frame)
    got = list(read_frames(path))
    assert [frame.seq for frame in got] == [0, 1, 2]
    for a, b in zip(frames, got, strict=True):
        assert np.array_equal(a.left, b.left) and np.array_equal(a.right, b.right)
        assert a.t_ns == b.t_ns and b.left.dtype == np.uint8
        assert np.array_equal(a.yaw_change_rad, b.yaw_change_rad, equal_nan=True)


def test_frames_may_come_from_another_thread(tmp_path: Path) -> None:
    path = tmp_path / "threads.mcap"
    image = np.zeros((64, 64), np.uint8)
    with LogWriter(path, header(), LogConfig(chunk_bytes=512)) as log:

        def film() -> None:
            for k in range(60):
                log.frame(StereoFrame(k, k, image, image))

        camera = threading.Thread(target=film)
        camera.start()
        for k in range(2000):
            log.event(Tick(k))
        camera.join()
    assert [event.t_ns for event in read_events(path)] == list(range(2000))
    assert [frame.seq for frame in read_frames(path)] == list(range(60))


def test_a_flushed_log_is_readable_before_it_is_closed(tmp_path: Path) -> None:
    path = tmp_path / "open.mcap"
    log = LogWriter(path, header())
    log.event(Tick(5))
    log.flush()
    assert list(read_events(path)) == [Tick(5)]
    log.close()
    log.close()


@pytest.mark.parametrize("share", [0.0, 0.001, 0.1, 0.4, 0.73, 0.95, 0.999])
def test_a_cut_log_gives_its_whole_chunks(
    log_path: Path, tmp_path: Path, story: list[tuple[Event, list[Command]]], share: float
) -> None:
    data = log_path.read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(data[: int(share * len(data))])
    try:
        with LogReader(cut) as log:
            got = texts(log.messages("event"))
            assert log.ending == "truncated"
            with pytest.raises(LogError, match=r"truncated.*recover"):
                log.require_complete()
    except LogError as error:
        assert share < 0.4 and str(cut) in str(error)
        return
    wanted = texts(event for event, _ in story)
    assert got == wanted[: len(got)]
    assert len(got) >= (share - 0.3) * len(wanted)  # at most a chunk and the index are lost


def test_every_cut_ends_in_data_or_a_sentence(log_path: Path, tmp_path: Path) -> None:
    data = log_path.read_bytes()
    cut = tmp_path / "cut.mcap"
    lengths = [*range(0, 64), *range(64, len(data), 1999), *range(len(data) - 40, len(data))]
    last = 0
    for length in lengths:
        cut.write_bytes(data[:length])
        try:
            count = sum(1 for _ in read_events(cut))
        except LogError as error:
            assert "\n" not in str(error) and str(error).endswith(".")
            assert count_is_possible(last, 0)
            continue
        assert count >= last
        last = count
    assert last == 200 * 4 + 200 // 5 + 200 // 50 + 1


def count_is_possible(last: int, count: int) -> bool:
    return last == count  # a sentence instead of data only while no data was ever readable


def test_a_flipped_byte_is_never_read_as_truth(
    log_path: Path, tmp_path: Path, story: list[tuple[Event, list[Command]]]
) -> None:
    data = bytearray(log_path.read_bytes())
    wanted = texts(event for event, _ in story)
    damaged = tmp_path / "damaged.mcap"
    rng = np.random.default_rng(7)
    for place in rng.integers(8, len(data), 80):
        data[place] ^= 0x41
        damaged.write_bytes(data)
        try:
            got = texts(read_events(damaged))
            assert got == wanted[: len(got)]
        except LogError as error:
            assert "\n" not in str(error)
        data[place] ^= 0x41


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "is empty"),
        (b"P5 640 480 255", "not an MCAP file"),
        (b"\x89MCAP0\r\n", "no Sweeper header"),
    ],
)
def test_a_foreign_file_is_refused(tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "other.bin"
    path.write_bytes(content)
    with pytest.raises(LogError, match=words):
        read_header(path)


def test_missing_places_are_refused(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="cannot be read"):
        list(read_events(tmp_path / "none.mcap"))
    with pytest.raises(LogError, match="cannot be written"):
        LogWriter(tmp_path / "none" / "log.mcap", header())


def test_another_format_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "new.mcap"
    monkeypatch.setattr("robot.log.header.FORMAT", "99")
    LogWriter(path, header()).close()
    monkeypatch.undo()
    with pytest.raises(LogError, match="format '99'"):
        read_header(path)


def test_a_cut_log_is_recovered(
    log_path: Path, tmp_path: Path, story: list[tuple[Event, list[Command]]]
) -> None:
    data = log_path.read_bytes()
    cut, saved = tmp_path / "cut.mcap", tmp_path / "saved.mcap"
    cut.write_bytes(data[: len(data) * 2 // 3])
    result = recover(cut, saved)
    assert result.messages > 500 and result.chunks > 3 and "no end" in result.sentence()
    with LogReader(saved) as log:
        log.require_complete()
        got = texts(log.messages("event"))
        assert log.ending == "complete"
        assert log.header.seed == 3
    assert got == texts(read_events(cut)) and len(got) > 200
    with pytest.raises(LogError, match="cannot be created"):
        recover(cut, saved)
    whole = recover(log_path, tmp_path / "whole.mcap")
    assert whole.problem == "" and texts(read_commands(tmp_path / "whole.mcap")) == texts(
        c for _, answers in story for c in answers
    )


def test_nothing_is_recovered_from_behind_a_gap(log_path: Path, tmp_path: Path) -> None:
    data = bytearray(log_path.read_bytes())
    with log_path.open("rb") as file:
        chunks = make_reader(file).get_summary().chunk_indexes
    chunk = chunks[len(chunks) // 3]
    data[chunk.chunk_start_offset + chunk.chunk_length // 2] ^= 0xFF
    damaged = tmp_path / "damaged.mcap"
    damaged.write_bytes(data)
    result = recover(damaged, tmp_path / "saved.mcap")
    assert "byte" in result.problem
    assert texts(read_events(tmp_path / "saved.mcap")) == texts(read_events(damaged))
