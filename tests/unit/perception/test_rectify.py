import cv2
import numpy as np
import pytest

from robot.config import PerceptionConfig, RobotConfig
from robot.errors import CalibrationError, FrameError
from robot.geometry.stereo import base_from_cam
from robot.messages import StereoFrame
from robot.perception.calibration import Eye, StereoCalibration
from robot.perception.chain import Perception
from robot.perception.depth import make_depth
from robot.perception.rectify import Rectifier

MOUNT = base_from_cam(0.13, 0.03, 0.09)


def calibration(
    size: tuple[int, int] = (752, 480), bend: float = -0.25, turn: float = 0.02
) -> StereoCalibration:
    """Two eyes that are turned against each other, distorted, and not quite level."""
    width, height = size
    eyes = [
        Eye(
            width,
            height,
            np.array(
                [[0.61 * width + k, 0, 0.49 * width], [0, 0.61 * width, 0.51 * height], [0, 0, 1]]
            ),
            np.array([bend, 0.06, 2e-4, -1e-4]),
        )
        for k in (0.0, 3.0)
    ]
    pose = np.eye(4)
    pose[:3, :3] = cv2.Rodrigues(np.array([0.6 * turn, turn, -0.8 * turn]))[0]
    pose[:3, 3] = [-0.06, 0.001, -0.0007]
    return StereoCalibration(eyes[0], eyes[1], pose)


def dots(eye: Eye, pose: np.ndarray, points: np.ndarray) -> np.ndarray:
    """A dark image with a small bright blob at every point's place."""
    turn = cv2.Rodrigues(pose[:3, :3])[0]
    places = cv2.projectPoints(points, turn, pose[:3, 3], eye.matrix, eye.distortion)[0][:, 0]
    v, u = np.mgrid[0 : eye.height_px, 0 : eye.width_px]
    image = np.zeros(u.shape)
    spread = 1.2 * eye.width_px / 400.0
    for x, y in places:
        image += 250.0 * np.exp(-((u - x) ** 2 + (v - y) ** 2) / (2 * spread**2))
    return np.rint(np.clip(image, 0, 255)).astype(np.uint8)


def centre(image: np.ndarray, u: float, v: float) -> np.ndarray:
    """Centroid of the blob near (u, v)."""
    x, y = round(u), round(v)
    part = image[y - 5 : y + 6, x - 5 : x + 6].astype(float)
    rows, columns = np.mgrid[y - 5 : y + 6, x - 5 : x + 6]
    return np.array([(part * columns).sum(), (part * rows).sum()]) / part.sum()


@pytest.mark.parametrize("size", [(752, 480), (640, 480), (1280, 720), (320, 240)])
def test_points_of_the_world_land_where_the_rectified_camera_says(size):
    raw = calibration(size)
    rectifier = Rectifier(raw, 320, 240, MOUNT)
    camera = rectifier.camera
    assert camera.baseline_m == pytest.approx(raw.baseline_m, rel=1e-6)
    # Points on a grid of the rectified left image, at several depths, in the rectified frame.
    grid = [(u, v) for u in (30, 110, 210, 290) for v in (30, 120, 210)]
    depths = np.resize([0.8, 1.5, 3.0], len(grid))
    rectified = np.array(
        [
            [(u - camera.cx_px) * z / camera.focal_px, (v - camera.cy_px) * z / camera.focal_px, z]
            for (u, v), z in zip(grid, depths, strict=True)
        ]
    )
    left_eye, right_eye = raw.left, raw.right
    turn = cv2.stereoRectify(
        left_eye.matrix, left_eye.distortion, right_eye.matrix, right_eye.distortion, size,
        raw.right_from_left[:3, :3], raw.right_from_left[:3, 3:4],
    )[0]  # fmt: skip
    points = rectified @ turn  # into the raw left frame
    left = dots(left_eye, np.eye(4), points)
    right = dots(right_eye, raw.right_from_left, points)
    flat_left, flat_right = rectifier.rectify(left, right)
    assert flat_left.shape == flat_right.shape == (240, 320)
    for (u, v), z in zip(grid, depths, strict=True):
        disparity = camera.focal_px * camera.baseline_m / z
        np.testing.assert_allclose(centre(flat_left, u, v), [u, v], atol=0.12)
        np.testing.assert_allclose(
            centre(flat_right, u - disparity, v), [u - disparity, v], atol=0.12
        )


def test_hardly_a_working_pixel_is_unseen():
    raw = calibration()
    white = np.full((480, 752), 255, np.uint8)
    for image in Rectifier(raw, 320, 240, MOUNT).rectify(white, white):
        assert np.mean(image < 255) < 0.001


def test_a_frame_of_another_size_is_refused():
    rectifier = Rectifier(calibration(), 320, 240, MOUNT)
    good = np.zeros((480, 752), np.uint8)
    with pytest.raises(FrameError, match="the right image is 640x480 px where 752x480"):
        rectifier.rectify(good, np.zeros((480, 640), np.uint8))
    with pytest.raises(FrameError, match="grey 8-bit"):
        rectifier.rectify(np.zeros((480, 752, 3), np.uint8), good)


@pytest.mark.parametrize("turn", [0.5, 1.0, 1.3, 2.0])
def test_eyes_that_share_no_view_are_refused(turn):
    with pytest.raises(CalibrationError, match="share no view"):
        Rectifier(calibration(turn=turn), 320, 240, MOUNT)


def test_the_chain_rectifies_raw_frames():
    rectifier = Rectifier(calibration(), 320, 240, MOUNT)
    config = PerceptionConfig()
    perception = Perception(
        config, RobotConfig(), rectifier.camera, make_depth(config, rectifier.camera), rectifier
    )
    rng = np.random.default_rng(0)
    raw = cv2.GaussianBlur(rng.integers(0, 255, (480, 752), np.uint8), (0, 0), 2.0)
    assert perception.see(StereoFrame(5, 1, raw, raw), 9).t_ns == 5
    with pytest.raises(FrameError, match="752x480 px is expected"):
        perception.see(StereoFrame(6, 2, raw[:240, :320], raw[:240, :320]), 10)
