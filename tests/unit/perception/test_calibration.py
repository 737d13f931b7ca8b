import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.errors import CalibrationError
from robot.perception.calibration_files import parse_calibration

EUROC = """%YAML:1.0
sensor_type: camera
T_BS:
  cols: 4
  rows: 4
  data: [1.0, 0.0, 0.0, {x}, 0.0, 1.0, 0.0, 0.02, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]
resolution: [640, 480]
camera_model: pinhole
intrinsics: [450.0, 451.0, 320.0, 240.0]
distortion_model: radial-tangential
distortion_coefficients: [-0.28, 0.07, 0.0002, 0.00002]
"""
ROS = """image_width: 640
image_height: 480
camera_name: {name}
camera_matrix: {{rows: 3, cols: 3, data: [450.0, 0, 320.0, 0, 451.0, 240.0, 0, 0, 1]}}
distortion_model: plumb_bob
distortion_coefficients: {{rows: 1, cols: 5, data: [-0.28, 0.07, 0.0002, 0.00002, 0.0]}}
rectification_matrix: {{rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}}
projection_matrix: {{rows: 3, cols: 4, data: [400, 0, 320, {tx}, 0, 400, 240, 0, 0, 0, 1, 0]}}
"""
KALIBR = """cam0:
  camera_model: pinhole
  intrinsics: [450.0, 451.0, 320.0, 240.0]
  distortion_model: radtan
  distortion_coeffs: [-0.28, 0.07, 0.0002, 0.00002]
  resolution: [640, 480]
cam1:
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.06]
  - [0.0, 1.0, 0.0, 0.0]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
  camera_model: pinhole
  intrinsics: [450.0, 451.0, 320.0, 240.0]
  distortion_model: radtan
  distortion_coeffs: [-0.28, 0.07, 0.0002, 0.00002]
  resolution: [640, 480]
"""
MATRIX = "!!opencv-matrix\n   rows: {rows}\n   cols: {cols}\n   dt: d\n   data: [{data}]\n"
EYE = MATRIX.format(rows=3, cols=3, data="450., 0., 320., 0., 451., 240., 0., 0., 1.")
BENT = MATRIX.format(rows=1, cols=5, data="-0.28, 0.07, 2.0e-04, 2.0e-05, 0.")
OPENCV = (
    "%YAML:1.0\n---\nimage_size: [ 640, 480 ]\n"
    f"M1: {EYE}D1: {BENT}M2: {EYE}D2: {BENT}"
    f"R: {MATRIX.format(rows=3, cols=3, data='1., 0., 0., 0., 1., 0., 0., 0., 1.')}"
    f"T: {MATRIX.format(rows=3, cols=1, data='-0.06, 0., 0.')}"
)
KITTI = (
    "P0: 700 0 600 0 0 700 180 0 0 0 1 0\n"
    "P1: 700 0 600 -378 0 700 180 0 0 0 1 0\n"
    "P2: 700 0 600 45 0 700 180 -0.3 0 0 1 0.005\n"
)


def euroc(left: str = "0.0", right: str = "0.06") -> tuple[str, str]:
    return EUROC.format(x=left), EUROC.format(x=right)


def ros() -> tuple[str, str]:
    return ROS.format(name="left", tx="0.0"), ROS.format(name="right", tx="-24.0")


@pytest.mark.parametrize(
    ("left", "right"), [euroc(), ros(), (KALIBR, None), (OPENCV, None)], ids="EROK"
)
def test_every_layout_gives_the_same_camera(left, right):
    calibration = parse_calibration(left, "left.yaml", right, "right.yaml")
    expected = np.eye(4)
    expected[0, 3] = -0.06
    np.testing.assert_allclose(calibration.right_from_left, expected, atol=1e-12)
    assert calibration.baseline_m == pytest.approx(0.06)
    for eye in (calibration.left, calibration.right):
        assert (eye.width_px, eye.height_px) == (640, 480)
        np.testing.assert_allclose(eye.matrix, [[450, 0, 320], [0, 451, 240], [0, 0, 1]])
        np.testing.assert_allclose(eye.distortion[:4], [-0.28, 0.07, 0.0002, 0.00002])


def test_kitti_is_rectified_and_needs_the_size():
    calibration = parse_calibration(KITTI, "calib.txt", size_px=(1226, 370))
    assert calibration.baseline_m == pytest.approx(0.54)
    assert not calibration.left.distortion.any()
    with pytest.raises(CalibrationError, match=r"calib\.txt: KITTI.*size"):
        parse_calibration(KITTI, "calib.txt")


def test_ros_rotation_hides_in_the_rectification_matrices():
    angle = 0.02
    c, s = np.cos(angle), np.sin(angle)
    left, right = ros()
    turned = f"[{c}, 0, {s}, 0, 1, 0, {-s}, 0, {c}]"
    right = right.replace("data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}", f"data: {turned}}}")
    pose = parse_calibration(left, "l", right, "r").right_from_left
    # R_right x_right = R_left x_left - (b, 0, 0), by the meaning of both matrices.
    point = np.array([0.3, -0.2, 2.0])
    rectified = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ (pose[:3, :3] @ point + pose[:3, 3])
    np.testing.assert_allclose(rectified, point - [0.06, 0, 0], atol=1e-12)


@pytest.mark.parametrize(
    ("text", "right", "says"),
    [
        (euroc()[0], None, "one eye only"),
        (*euroc("0.06", "0.0"), "baseline is negative"),
        (*euroc("0.0", "60.0"), "baseline is 60 m"),
        (*euroc("0.0", "0.0"), "baseline is 0 m"),
        (euroc()[0].replace("intrinsics", "intrinsic"), euroc()[1], "intrinsics is missing"),
        (euroc()[0].replace("450.0, 451.0", "450.0"), euroc()[1], "intrinsics is not 4 numbers"),
        (euroc()[0].replace("450.0, 451.0", "4.5, 4.5"), euroc()[1], "focal length"),
        (euroc()[0].replace("450.0", ".nan"), euroc()[1], "not finite"),
        (euroc()[0].replace("320.0, 240.0", "720.0, 240.0"), euroc()[1], "principal point"),
        (euroc()[0].replace("640, 480", "320, 240"), euroc()[1], "principal point|same size"),
        (euroc()[0].replace("640, 480", "646, 480"), euroc()[1], "same size"),
        (euroc()[0].replace("[640, 480]", "[640]"), euroc()[1], "width and height"),
        (euroc()[0].replace("radial-tangential", "equidistant"), euroc()[1], "equidistant"),
        (euroc()[0].replace("[1.0, 0.0", "[1.2, 0.0"), euroc()[1], "not a rotation"),
        (euroc()[0].replace("rows: 4", "rows: [4"), euroc()[1], "not valid YAML"),
        (*(t.replace("-24.0", "0.0") for t in ros()), "has no baseline"),
        (KALIBR.replace("T_cn_cnm1", "T_cam_imu"), None, "T_cn_cnm1 is missing"),
        (KALIBR.replace("cam1:", "cam2:"), None, "cam1 is missing"),
        (OPENCV.replace("image_size", "size"), None, "image_size is missing"),
        (OPENCV.replace("-0.06, 0., 0.", "-0.06"), None, "T is not 3 numbers"),
        (OPENCV.replace("-0.06, 0., 0.", "0., -0.06, 0."), None, "negative|above each other"),
        (OPENCV.replace("-0.28, 0.07, 2", "-0.28, 0.07, 1., 2"), None, "has 6 numbers"),
        ("hello: 1", None, "not a known stereo calibration"),
        ("just words", None, "holds no keys"),
    ],
)
def test_what_is_wrong_is_said_in_one_sentence(text, right, says):
    with pytest.raises(CalibrationError, match=says) as caught:
        parse_calibration(text, "left.yaml", right, "right.yaml")
    message = str(caught.value)
    assert message.startswith("left.yaml") or "right.yaml" in message
    assert message.endswith(".") and "\n" not in message


@settings(max_examples=60, deadline=None)
@given(st.integers(0, len(OPENCV)), st.text(max_size=8))
def test_a_damaged_file_is_refused_or_read_but_never_crashes(where, junk):
    try:
        calibration = parse_calibration(OPENCV[:where] + junk + OPENCV[where + 3 :], "file")
    except CalibrationError:
        return
    assert 0.005 <= calibration.baseline_m <= 2.0
