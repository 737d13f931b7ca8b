"""The pipeline bench on a small synthetic recording: figures, pictures, and what is null."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from robot.bench.memory import peak_rss_mb, reset_peak
from robot.bench.pipeline import bench_pipeline, track_error_m
from robot.body.recordings import open_recording
from robot.config import Config, parse_config
from robot.errors import CalibrationError, FrameError
from robot.evaluate.frame_picture import disparity_colours, draw_frame
from robot.geometry.stereo import StereoCamera, base_from_cam
from robot.messages import Landmark, Scan, Seen

FRAMES, SHIFT_PX = 18, 12


def make_street(root: Path) -> Path:
    """A flat textured board, `SHIFT_PX` of disparity away, driven along by a pixel a frame."""
    rng = np.random.default_rng(3)
    board = cv2.GaussianBlur(rng.uniform(0, 255, (240, 420)), (0, 0), 1.5)
    board = cv2.normalize(board, None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)
    for eye in (0, 1):
        (root / f"image_{eye}").mkdir(parents=True)
        for k in range(FRAMES):
            start = 40 + k + eye * SHIFT_PX
            file = root / f"image_{eye}" / f"{k:06d}.png"
            cv2.imwrite(str(file), board[:, start : start + 320])
    (root / "times.txt").write_text("".join(f"{0.1 * k}\n" for k in range(FRAMES)))
    (root / "calib.txt").write_text(
        "P0: 228 0 159.5 0 0 228 119.5 0 0 0 1 0\nP1: 228 0 159.5 -13.68 0 228 119.5 0 0 0 1 0\n"
    )
    return root


@pytest.fixture(scope="module")
def config() -> Config:
    return parse_config('[perception]\nmatcher = "sgbm"\n')


def test_a_recording_gives_exactly_the_promised_figures(tmp_path: Path, config: Config) -> None:
    root = make_street(tmp_path / "street")
    (root / "image_1" / f"{FRAMES - 1:06d}.png").write_bytes(b"damaged")
    result = bench_pipeline([tmp_path], config, tmp_path / "out")
    assert list(result) == ["sequences"] and len(result["sequences"]) == 1
    row = result["sequences"][0]
    assert list(row) == [
        "name", "frames", "frames_lost", "fps", "stage_ms", "peak_rss_mb", "ate_rmse_m",
    ]  # fmt: skip
    assert (row["name"], row["frames"], row["frames_lost"]) == ("street", FRAMES - 1, 1)
    assert row["ate_rmse_m"] is None  # there is no truth
    stages = row["stage_ms"]
    assert {"brain", "frame", "read"} < stages.keys()
    assert all(set(figures) == {"p50", "p95", "p99"} for figures in stages.values())
    frame_ms = stages["frame"]["p50"]
    assert 0.3 * 1000.0 / frame_ms < row["fps"] < 3.0 * 1000.0 / frame_ms
    assert 20.0 < row["peak_rss_mb"] < 2000.0
    json.dumps(result, allow_nan=False)


def test_the_pictures_show_the_disparity(tmp_path: Path, config: Config) -> None:
    threads = cv2.getNumThreads()
    bench_pipeline([make_street(tmp_path / "street")], config, tmp_path / "out")
    assert cv2.getNumThreads() == threads
    files = sorted((tmp_path / "out").iterdir())
    assert [file.name for file in files] == [f"street_{k:06d}.png" for k in (3, 9, 15)]
    picture = cv2.imread(str(files[1]))
    assert picture.shape == (480, 1280, 3)
    wanted = disparity_colours(np.full((1, 1), float(SHIFT_PX)), 64.0)[0, 0].astype(int)
    inside = picture[100:380, 640 + 200 : 640 + 560].astype(int)
    near = np.abs(inside - wanted).max(axis=2) < 25
    assert near.mean() > 0.9
    left = cv2.imread(str(files[2]))[:, :640]
    assert np.ptp(left.astype(int), axis=2).max() > 100  # coloured landmarks on the grey image


def test_bad_folders_are_explained(tmp_path: Path, config: Config) -> None:
    with pytest.raises(FrameError, match="no such folder"):
        bench_pipeline([tmp_path / "none"], config, tmp_path / "out")
    root = make_street(tmp_path / "street")
    (root / "calib.txt").unlink()
    with pytest.raises(CalibrationError, match=r"calib\.txt"):
        bench_pipeline([root], config, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def write_truth(root: Path, height_m: float) -> None:
    """The camera moves 0.5 m a frame along its z axis, and heaves."""
    rows = (f"1 0 0 0 0 1 0 {height_m * (k % 2)} 0 0 1 {0.5 * k}" for k in range(FRAMES))
    (root / "poses.txt").write_text("\n".join(rows))


def test_the_track_is_judged_only_in_a_plane(tmp_path: Path) -> None:
    root = make_street(tmp_path / "street")
    mount = base_from_cam(0.0, 0.0, 1.65)
    t_s = 0.1 * np.arange(FRAMES)
    straight = np.column_stack([t_s, 0.5 * np.arange(FRAMES), np.zeros((FRAMES, 2))])
    write_truth(root, 0.0)
    assert track_error_m(open_recording(root), mount, straight) == 0.0
    short = straight * np.array([1.0, 0.5, 1.0, 1.0])
    assert track_error_m(open_recording(root), mount, short) == pytest.approx(
        0.25 * np.std(np.arange(FRAMES)), abs=1e-4
    )
    assert track_error_m(open_recording(root), mount, straight[:0]) is None
    write_truth(root, 1.0)
    assert track_error_m(open_recording(root), mount, straight) is None


def test_a_picture_marks_what_was_seen() -> None:
    camera = StereoCamera(40, 30, 30.0, 19.5, 14.5, 0.06, base_from_cam(0.0, 0.0, 0.1))
    ahead = Landmark(2.0, 0.0, np.diag([0.01, 1e-6]), bytes(32), "edge", 0.1)
    behind = Landmark(2.0, 3.0, np.diag([0.01, 1e-6]), bytes(32))
    empty = np.zeros(0)
    seen = Seen(0, 0, 0, (ahead, behind), Scan(empty, empty, empty), 1.0)
    disparity = np.full((30, 40), np.nan)
    disparity[:, 20:] = 64.0
    png = draw_frame(np.full((30, 40), 90, np.uint8), disparity, camera, seen, 64.0)
    picture = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)
    assert picture.shape == (60, 160, 3)
    assert picture[29, 39].tolist() == [255, 120, 40]  # the edge, straight ahead
    coloured = np.ptp(picture[:, :80].astype(int), axis=2) > 0
    assert 10 < coloured.sum() < 80  # and nothing of what is behind
    assert picture[30, 90].tolist() == [0, 0, 0]  # unknown
    blue, green, red = picture[30, 150].tolist()
    assert red > 100 and blue < 30 and green < 30


def test_the_peak_is_that_of_the_measured_part() -> None:
    reset_peak()
    before = peak_rss_mb()
    block = np.ones(40_000_000, np.uint8)
    assert block[-1] == 1
    during = peak_rss_mb()
    del block
    assert 30.0 < during - before < 80.0
