"""Info, cuts and exports of a small log with frames."""

import math

import cv2
import numpy as np
import pytest

from robot.body.records.log_files import export_log, log_info
from robot.cli import main
from robot.config import Config, dump_config
from robot.errors import LogError
from robot.geometry.se2 import SE2
from robot.log.cut import cut
from robot.log.header import LogHeader
from robot.log.reader import read_events, read_frames
from robot.log.writer import LogWriter
from robot.messages import Grid, MapReport, PoseEstimate, StereoFrame, Tick

NS = 1_000_000_000


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "log.mcap"
    header = LogHeader(dump_config(Config()), scene="flat", seed=3, body="sim")
    rng = np.random.default_rng(1)
    with LogWriter(path, header) as writer:
        for second in range(10):
            t_ns = second * NS
            writer.event(Tick(t_ns))
            pose = SE2(0.1 * second, 0.0, 0.2)
            writer.command(PoseEstimate(t_ns, pose, np.eye(3), "ok"))
            image = rng.integers(0, 255, (24, 32), dtype=np.uint8)
            writer.frame(StereoFrame(t_ns, second, image, image))
            writer.truth(t_ns, pose)
        grid = Grid(0.05, 0.0, 0.0, np.zeros((4, 5), np.int8))
        covered = np.zeros((4, 5), bool)
        writer.command(MapReport(9 * NS, grid, covered, np.zeros((0, 2)), np.zeros((0, 2, 2))))
    return path


def test_info_tells_what_is_in_it(log, capsys):
    info = log_info(log)
    assert info["ending"] == "complete" and info["duration_s"] == 9.0 and info["seed"] == 3
    assert info["messages"]["event/Tick"] == 10 and info["messages"]["frame/FrameStamp"] == 10
    assert main(["log", "info", str(log)]) == 0
    assert "event/Tick: 10" in capsys.readouterr().out


def test_a_cut_holds_its_span_and_is_a_whole_log(log, tmp_path):
    out = tmp_path / "part.mcap"
    result = cut(log, out, 2.5, 6.0)
    assert [e.t_ns / NS for e in read_events(out)] == [3, 4, 5, 6]
    assert [f.seq for f in read_frames(out)] == [3, 4, 5, 6]
    assert result.problem == "" and log_info(out)["ending"] == "complete"


def test_a_cut_without_pictures_has_none(log, tmp_path):
    out = tmp_path / "part.mcap"
    cut(log, out, 0.0, math.inf, pictures=False)
    assert list(read_frames(out)) == [] and b"PNG" not in out.read_bytes()
    assert len(list(read_events(out))) == 10


def test_a_cut_of_a_truncated_log_keeps_what_is_there(log, tmp_path):
    short = tmp_path / "short.mcap"
    short.write_bytes(log.read_bytes()[:-2000])
    try:
        result = cut(short, tmp_path / "part.mcap", 0.0, math.inf)
    except LogError as error:
        assert "nothing lies between" in str(error)
    else:
        assert "no end" in result.problem


@pytest.mark.parametrize("span", [(5.0, 2.0), (-1.0, 2.0), (100.0, 200.0)])
def test_empty_spans_are_explained_and_leave_nothing(log, tmp_path, span):
    out = tmp_path / "part.mcap"
    with pytest.raises(LogError):
        cut(log, out, *span)
    assert not out.exists()
    out.write_text("mine")
    with pytest.raises(LogError, match="cannot be created"):
        cut(log, out, 0.0, 1.0)
    assert out.read_text() == "mine"


def test_exports_are_what_they_say(log, tmp_path):
    assert export_log(log, tmp_path, "tum") == ["trajectory.tum", "truth.tum"]
    assert len((tmp_path / "trajectory.tum").read_text().splitlines()) == 11
    assert export_log(log, tmp_path, "map_server") == ["map.pgm", "map.yaml"]
    assert len(export_log(log, tmp_path / "png", "png")) == 10
    assert cv2.imread(str(tmp_path / "png" / "000000.png")).shape[:2] == (24, 64)
    export_log(log, tmp_path / "asl", "euroc")
    assert len(list((tmp_path / "asl/mav0/cam1/data").iterdir())) == 10
    assert export_log(log, tmp_path, "mp4") == ["frames.mp4"]
    video = cv2.VideoCapture(str(tmp_path / "frames.mp4"))
    assert int(video.get(cv2.CAP_PROP_FRAME_COUNT)) == 10


def test_the_exported_frames_are_the_recorded_ones(log, tmp_path):
    export_log(log, tmp_path, "euroc")
    first = next(iter(read_frames(log)))
    kept = cv2.imread(str(tmp_path / "mav0/cam0/data" / f"{0:019d}.png"), cv2.IMREAD_UNCHANGED)
    assert np.array_equal(kept, first.left)


def test_what_a_log_lacks_is_explained(log, tmp_path):
    part = tmp_path / "part.mcap"
    cut(log, part, 0.0, math.inf, pictures=False)
    assert main(["log", "export", str(part), str(tmp_path), "--to", "mp4"]) == 2
