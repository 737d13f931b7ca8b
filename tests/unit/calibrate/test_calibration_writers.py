"""What is written is read back the same, by the runtime and by OpenCV."""

import cv2
import numpy as np
import pytest
from board_pictures import LEFT_LENS, MATRIX, RIGHT_LENS, SIZE, right_from_left

from robot.calibrate.files import FORMATS, Provenance, write_calibration
from robot.cli import main
from robot.errors import CalibrationError
from robot.perception.calibration import Eye, StereoCalibration
from robot.perception.calibration_files import parse_calibration


def calibration(left=LEFT_LENS):
    return StereoCalibration(
        Eye(*SIZE, MATRIX, left), Eye(*SIZE, MATRIX + np.diag([0.25, 0.25, 0.0]), RIGHT_LENS),
        right_from_left(), "made",
    )  # fmt: skip


@pytest.mark.parametrize("layout", FORMATS)
def test_every_layout_is_read_back(layout):
    made = calibration()
    read = parse_calibration(*_interleave(write_calibration(made, layout)))
    for mine, theirs in ((made.left, read.left), (made.right, read.right)):
        assert np.allclose(mine.matrix, theirs.matrix)
        assert np.allclose(mine.distortion[:4], theirs.distortion[:4])
        assert (theirs.width_px, theirs.height_px) == SIZE
    assert np.allclose(made.right_from_left, read.right_from_left, atol=1e-6)


def _interleave(texts):
    return [texts[0], "one"] + ([texts[1], "two"] if len(texts) == 2 else [])


def test_opencv_reads_its_own_layout(tmp_path):
    path = tmp_path / "stereo.yaml"
    provenance = Provenance("2030-01-02T03:04:05+00:00", 0.21, 0.11)
    path.write_text(write_calibration(calibration(), "opencv", provenance)[0])
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    assert np.allclose(storage.getNode("M1").mat(), MATRIX)
    assert np.allclose(storage.getNode("T").mat().ravel(), right_from_left()[:3, 3])
    assert storage.getNode("calibration_date").string() == provenance.date
    assert storage.getNode("epipolar_px").real() == 0.11


def test_eight_coefficients_survive_ros():
    wide = np.array([0.1, 0.2, 0.0, 0.0, 0.05, 0.1, 0.02, 0.01])
    made = calibration(wide)
    read = parse_calibration(*_interleave(write_calibration(made, "ros")))
    assert np.allclose(read.left.distortion, wide)


def test_kalibr_refuses_what_its_model_cannot_say():
    with pytest.raises(CalibrationError, match="k3"):
        write_calibration(calibration(np.array([0.1, 0.0, 0.0, 0.0, 0.3])), "kalibr")


def test_convert_goes_round(tmp_path):
    first = tmp_path / "a.yaml"
    first.write_text(write_calibration(calibration(), "opencv")[0])
    ros = tmp_path / "ros.yaml"
    assert main(["calibrate", "convert", str(first), "--layout", "ros", "--out", str(ros)]) == 0
    pair = [str(tmp_path / f"ros.{side}.yaml") for side in ("left", "right")]
    last = tmp_path / "b.yaml"
    assert main(["calibrate", "convert", *pair, "--layout", "kalibr", "--out", str(last)]) == 0
    read = parse_calibration(last.read_text(), "b")
    assert np.allclose(read.right_from_left, right_from_left(), atol=1e-6)


def test_convert_explains_what_it_cannot_read(tmp_path, capsys):
    missing = str(tmp_path / "none.yaml")
    assert main(["calibrate", "convert", missing, "--out", missing]) == 2
    assert "none.yaml" in capsys.readouterr().err
