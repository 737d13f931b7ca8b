"""Calibration recovers the cameras that took the views, and refuses what is poor."""

import json

import cv2
import numpy as np
import pytest
from board_pictures import (
    LEFT_LENS,
    MATRIX,
    MOVE,
    SIZE,
    board_poses,
    picture,
    right_from_left,
    views,
)

from robot.body.calibration.views import Chooser
from robot.calibrate.board import Found, parse_board
from robot.calibrate.coverage import Coverage
from robot.calibrate.stereo import View, calibrate_stereo
from robot.cli import main
from robot.errors import CalibrationError
from robot.messages import StereoFrame
from robot.perception.calibration_files import parse_calibration

CHESS = parse_board("chess:8x6:24mm")


def test_the_cameras_are_recovered():
    found = calibrate_stereo(views(CHESS, 20), CHESS, SIZE)
    calibration = found.calibration
    assert calibration.left.matrix[0, 0] == pytest.approx(MATRIX[0, 0], rel=0.005)
    assert calibration.baseline_m == pytest.approx(np.linalg.norm(MOVE), rel=0.01)
    assert np.abs(calibration.right_from_left[:3, :3] - right_from_left()[:3, :3]).max() < 2e-3
    assert calibration.left.distortion[0] == pytest.approx(LEFT_LENS[0], abs=0.03)
    assert found.rms_px == pytest.approx(0.08 * np.sqrt(2), rel=0.2)
    assert found.epipolar_px < 0.12
    assert found.epipolar_px <= found.unseen_epipolar_px < 0.16
    assert found.left_out == ()


def test_a_view_that_does_not_fit_is_left_out_and_named():
    made = views(CHESS, 14)
    bent = made[5].right.pixel + np.random.default_rng(2).normal(0, 4, (48, 2)).astype(np.float32)
    made[5] = View("blurred", made[5].left, Found(made[5].right.ids, bent))
    found = calibrate_stereo(made, CHESS, SIZE)
    assert found.left_out == ("blurred",)
    assert found.epipolar_px < 0.15


def test_poor_corners_are_refused():
    found = calibrate_stereo(views(CHESS, 12, noise_px=1.0), CHESS, SIZE)
    with pytest.raises(CalibrationError, match=r"poor: RMS .*limit 0\.5.*take more pictures"):
        found.refuse_above(0.5, 0.3)
    found.refuse_above(9.0, 9.0)


def test_too_few_views_are_refused():
    with pytest.raises(CalibrationError, match="7 pairs where 8"):
        calibrate_stereo(views(CHESS, 7), CHESS, SIZE)


def test_a_partly_seen_board_counts_by_its_common_corners():
    made = views(CHESS, 12)
    part = np.arange(0, 48, 2)
    made = [View(v.name, Found(v.left.ids[part], v.left.pixel[part]), v.right) for v in made]
    assert calibrate_stereo(made, CHESS, SIZE).epipolar_px < 0.15


def test_swapped_eyes_are_refused():
    swapped = [View(v.name, v.right, v.left) for v in views(CHESS, 10)]
    with pytest.raises(CalibrationError, match="swap the two cameras"):
        calibrate_stereo(swapped, CHESS, SIZE)


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pairs")
    for k, pose in enumerate(board_poses(9, CHESS, np.random.default_rng(4))):
        for side in ("left", "right"):
            image = picture(CHESS, *pose, right=side == "right")
            cv2.imwrite(str(folder / f"{side}{k}.png"), image)
    return folder


def test_from_a_folder_of_pictures_to_a_file_that_the_runtime_reads(pictures, tmp_path, capsys):
    out, report = tmp_path / "stereo.yaml", tmp_path / "report.json"
    code = main(
        ["calibrate", "stereo", "--frames", str(pictures), "--board", "chess:8x6:24mm",
         "--out", str(out), "--json", str(report)]
    )  # fmt: skip
    assert code == 0
    told = json.loads(report.read_text())
    assert told["epipolar_px"] < 0.3 and told["files"] == [str(out)]
    assert "#" in capsys.readouterr().out  # the covered part of the image
    read = parse_calibration(out.read_text(), "stereo.yaml")
    assert read.baseline_m == pytest.approx(0.06, rel=0.02)


def test_a_wrong_board_or_a_limit_leaves_the_old_file_alone(pictures, tmp_path, capsys):
    out = tmp_path / "stereo.yaml"
    out.write_text("old")
    base = ["calibrate", "stereo", "--frames", str(pictures), "--out", str(out)]
    assert main([*base, "--board", "chess:9x6:24mm"]) == 2
    assert main([*base, "--board", "chess:8x6:24mm", "--max-epipolar-px", "0.001"]) == 2
    assert "limit 0.001" in capsys.readouterr().err
    assert out.read_text() == "old"


def test_coverage_counts_cells_and_says_where_to_go():
    coverage = Coverage((80, 60))
    coverage.add(Found(np.arange(3), np.array([[1, 1], [5, 5], [79, 59]], np.float32)))
    assert coverage.share == pytest.approx(2 / 48)
    assert coverage.picture().splitlines()[0] == "+......."
    assert coverage.picture().splitlines()[-1] == ".......+"
    grid = np.mgrid[0:40:1, 0:60:1].reshape(2, -1).T.astype(np.float32)
    coverage.add(Found(np.arange(len(grid)), grid))
    assert "right" in coverage.advice()
    coverage.add(Found(np.arange(len(grid)), grid + (40, 0)))
    assert coverage.advice() == "" and coverage.share == 1.0


def test_live_pictures_are_taken_when_the_board_is_still_and_somewhere_new(pictures):
    def frame(name, seq):
        eyes = [cv2.imread(str(pictures / f"{side}{name}.png"), 0) for side in ("left", "right")]
        return StereoFrame(0, seq, *eyes)

    chooser = Chooser(CHESS, SIZE[0])
    both = [
        n for n in range(9) if all(CHESS.find(e) for e in (frame(n, 0).left, frame(n, 0).right))
    ]
    one, other = both[:2]
    assert chooser.consider(frame(one, 0)) is None  # is it still?
    assert chooser.consider(frame(one, 1)) is not None
    assert chooser.consider(frame(one, 2)) is None  # nothing new
    assert chooser.consider(frame(other, 3)) is None  # it moved
    assert chooser.consider(frame(other, 4)) is not None
