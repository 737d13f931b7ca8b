"""What every stereo source promises, tried on each of them; libcamera's against a fake library."""

import json
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from robot.errors import FrameError, HardwareError
from robot.hardware.frames_folder import FramesFolder
from robot.hardware.libcamera_stereo import LibcameraStereo
from robot.hardware.stereo import WatchedStereo
from robot.hardware.uvc import UvcStereo

FAKE = Path(__file__).with_name("fake_libcamera")
WIDTH, HEIGHT = 32, 24


def libcamera(cameras=("0",), there=None, timeout_s=1.0, exposure_us=5000, **behaviour):
    behaviour = {"cameras": there or len(cameras), **behaviour}
    environment = {"PYTHONPATH": str(FAKE), "FAKE_LIBCAMERA": json.dumps(behaviour)}
    return LibcameraStereo(
        cameras, eye_width_px=WIDTH, eye_height_px=HEIGHT, rate_hz=50.0, gain=1.0,
        exposure_us=exposure_us, timeout_s=timeout_s, python=(sys.executable, "-S"),
        environment=environment,
    )  # fmt: skip


def composite(_):
    return libcamera()


def dual(_):
    return libcamera(("/base/fake@1", "0"), skew_us=300)


def uvc(folder):
    path = str(folder / "pair.avi")
    writer = cv2.VideoWriter(path, cv2.VideoWriter_fourcc(*"MJPG"), 50, (2 * WIDTH, HEIGHT))
    for _ in range(8):
        writer.write(np.full((HEIGHT, 2 * WIDTH, 3), 60, np.uint8))
    writer.release()
    return UvcStereo(path, eye_width_px=WIDTH, eye_height_px=HEIGHT)


def folder(folder):
    for n in (1, 2, 10, 11, 12, 13, 14, 15):
        for side in ("left", "right"):
            level = n + (100 if side == "right" else 0)
            cv2.imwrite(str(folder / f"{side}{n}.png"), np.full((HEIGHT, WIDTH), level, np.uint8))
    return FramesFolder(folder, rate_hz=200.0)


SOURCES = [composite, dual, uvc, folder]


@pytest.fixture(params=SOURCES, ids=lambda s: s.__name__)
def source(request, tmp_path):
    made = request.param(tmp_path)
    yield made
    made.close()


def frames(source, count=5):
    got = []
    for _ in range(count):
        frame = source.read()
        assert frame is not None
        got.append((frame, time.monotonic_ns()))
    return got


def test_eyes_are_grey_contiguous_and_of_the_size_asked(source):
    for frame, _ in frames(source):
        for eye in (frame.left, frame.right):
            assert eye.shape == (HEIGHT, WIDTH)
            assert eye.dtype == np.uint8
            assert eye.flags.c_contiguous


def test_time_is_when_it_was_exposed_and_rises(source):
    opened_ns = time.monotonic_ns() - 1_000_000_000
    got = frames(source)
    times = [f.t_ns for f, _ in got]
    assert all(np.diff(times) > 0)
    assert all(opened_ns < f.t_ns <= read_ns for f, read_ns in got)


def test_numbers_rise(source):
    assert all(np.diff([f.seq for f, _ in frames(source)]) > 0)


def test_a_frame_is_not_changed_by_the_next_one(source):
    first, _ = frames(source, 1)[0]
    before = first.left.copy()
    frames(source, 3)
    assert np.array_equal(first.left, before)


def test_closing_twice_is_no_error_and_nothing_comes_afterwards(source):
    source.read()
    source.close()
    source.close()
    assert source.read() is None


# ---------------------------------------------------------------- libcamera's own


def test_the_two_halves_are_the_two_eyes():
    camera = libcamera()
    frame = camera.read()
    camera.close()
    assert set(frame.left.ravel()) == {60} and set(frame.right.ravel()) == {40}


def test_frames_are_stamped_by_the_sensor_not_by_their_arrival():
    camera = libcamera()
    ages_ms = [(read_ns - f.t_ns) / 1e6 for f, read_ns in frames(camera)]
    camera.close()
    assert min(ages_ms) > 2.9  # the fake exposes 3 ms before it delivers


def test_two_cameras_report_how_far_apart_their_exposures_are():
    camera = dual(None)
    for _ in range(5):
        assert camera.read() is not None
        assert 0 < abs(camera.difference_ns) <= 1_000_000
    camera.close()


def test_eyes_that_are_never_exposed_together_are_no_frame():
    camera = libcamera(("0", "1"), timeout_s=0.3, skew_us=8000)
    assert camera.read() is None
    camera.close()


def test_automatic_exposure_brings_both_eyes_to_the_same_brightness():
    camera = libcamera(("0", "1"), exposure_us=0, grey=30, period_s=0.005)
    frame = None
    for _ in range(80):
        frame = camera.read()
    camera.close()
    assert 90 < frame.left[0, 0] < 130
    assert frame.left[0, 0] == frame.right[0, 0]


def test_a_slow_reader_gets_the_newest_frame():
    camera = libcamera(period_s=0.01)
    camera.read()
    time.sleep(0.4)
    frame = camera.read()
    age_s = (time.monotonic_ns() - frame.t_ns) / 1e9
    camera.close()
    assert age_s < 0.2


def test_a_pipeline_that_hangs_is_ended_in_time():
    camera = libcamera(timeout_s=0.3, silent_after=3)
    start_s = time.monotonic()
    got = [camera.read() for _ in range(6)]
    assert got[-1] is None
    assert time.monotonic() - start_s < 3.0
    assert camera._process.returncode is not None


@pytest.mark.parametrize(
    ("cameras", "behaviour", "sentence"),
    [
        (("7",), {"there": 1}, r"no camera '7' \(there are: 0: /base/fake@0\).*camera.device"),
        (("0",), {"there": -1}, r"there are: none.*dtoverlay"),
        (("0",), {"size": [1640, 1232]}, r"delivers 1640x1232 px where 64x24 are"),
    ],
)
def test_what_cannot_start_says_why(cameras, behaviour, sentence):
    with pytest.raises(HardwareError, match=sentence):
        libcamera(cameras, **behaviour)


def test_a_missing_libcamera_names_its_package(tmp_path):
    with pytest.raises(HardwareError, match="python3-libcamera"):
        LibcameraStereo(
            ("0",), eye_width_px=WIDTH, eye_height_px=HEIGHT, rate_hz=10.0,
            python=(sys.executable, "-S"),
        )  # fmt: skip
    with pytest.raises(HardwareError, match="no-python"):
        LibcameraStereo(
            ("0",), eye_width_px=WIDTH, eye_height_px=HEIGHT, rate_hz=10.0,
            python=(str(tmp_path / "no-python"),),
        )  # fmt: skip


# ---------------------------------------------------------------- the watchman


def test_a_lost_camera_is_opened_again_and_numbered_on():
    opened = []

    def open_source():
        opened.append(libcamera(timeout_s=0.3, silent_after=4))
        return opened[-1]

    camera = WatchedStereo(open_source)
    seqs, end_s = [], time.monotonic() + 8.0
    while len(opened) < 3 and time.monotonic() < end_s:
        frame = camera.read()
        if frame is not None:
            seqs.append(frame.seq)
        else:
            assert camera.problem
            time.sleep(0.01)
    camera.close()
    assert camera.restarts == 2
    assert all(np.diff(seqs) > 0) and len(seqs) > 4


def test_a_camera_that_stays_away_is_asked_ever_more_rarely():
    now_s, tries = [0.0], []

    class Dead:
        def read(self):
            return None

        def close(self):
            pass

    def open_source():
        tries.append(now_s[0])
        if len(tries) > 1:
            raise HardwareError("gone")
        return Dead()

    camera = WatchedStereo(open_source, clock=lambda: now_s[0])
    while now_s[0] < 60.0:
        assert camera.read() is None
        now_s[0] += 0.1
    assert 8 <= len(tries) <= 14
    assert np.diff(tries)[-1] == pytest.approx(8.0, abs=0.2)
    assert camera.problem == "gone"


# ---------------------------------------------------------------- the folder's own


def test_names_are_counted_not_spelled(tmp_path):
    camera = folder(tmp_path)
    assert [camera.read().left[0, 0] for _ in range(3)] == [1, 2, 10]


def test_an_eye_without_its_other_is_named(tmp_path):
    folder(tmp_path).close()
    (tmp_path / "right11.png").unlink()
    with pytest.raises(FrameError, match=r"11\.png"):
        FramesFolder(tmp_path)


def test_side_by_side_pictures_are_cut(tmp_path):
    both = np.hstack([np.full((4, 6), 10, np.uint8), np.full((4, 6), 200, np.uint8)])
    cv2.imwrite(str(tmp_path / "a.png"), both)
    frame = FramesFolder(tmp_path).read()
    assert frame.left.mean() == 10 and frame.right.mean() == 200


@pytest.mark.parametrize("what", ["missing", "empty", "broken"])
def test_an_unusable_folder_is_explained(tmp_path, what):
    if what == "broken":
        (tmp_path / "x.png").write_bytes(b"no picture")
    target = tmp_path / "none" if what == "missing" else tmp_path
    with pytest.raises(FrameError, match=r"; \w+"):
        FramesFolder(target).read()
