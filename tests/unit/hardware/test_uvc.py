"""The side-by-side camera, fed from a real video file through the same OpenCV path."""

import cv2
import numpy as np
import pytest

from robot.errors import FrameError, HardwareError
from robot.hardware.stereo import split_side_by_side
from robot.hardware.uvc import UvcStereo


@pytest.fixture
def video(tmp_path):
    path = str(tmp_path / "pair.avi")
    writer = cv2.VideoWriter(path, cv2.VideoWriter_fourcc(*"MJPG"), 10, (64, 24))
    for level in (40, 80, 120):
        image = np.full((24, 64, 3), level, np.uint8)
        image[:, 32:] = level + 100
        writer.write(image)
    writer.release()
    return path


def test_frames_are_cut_into_eyes_and_counted(video):
    stamps = iter(range(100, 200))
    camera = UvcStereo(video, eye_width_px=32, eye_height_px=24, clock=lambda: next(stamps))
    frames = [camera.read() for _ in range(3)]
    assert [f.seq for f in frames] == [0, 1, 2]
    assert [f.t_ns for f in frames] == [100, 101, 102]
    for frame, level in zip(frames, (40, 80, 120), strict=True):
        assert frame.left.shape == frame.right.shape == (24, 32)
        assert abs(float(frame.left[:, :28].mean()) - level) < 3
        assert abs(float(frame.right[:, 4:].mean()) - level - 100) < 3


def test_the_end_of_the_stream_is_none(video):
    camera = UvcStereo(video, eye_width_px=32, eye_height_px=24)
    for _ in range(3):
        assert camera.read() is not None
    assert camera.read() is None
    camera.close()


def test_a_missing_camera_is_explained(tmp_path):
    with pytest.raises(HardwareError, match=r"camera\.device.*/dev/video"):
        UvcStereo(str(tmp_path / "none.avi"), eye_width_px=32, eye_height_px=24)


def test_an_odd_frame_is_refused():
    with pytest.raises(FrameError, match="side by side"):
        split_side_by_side(np.zeros((4, 5), np.uint8), "camera 0")
