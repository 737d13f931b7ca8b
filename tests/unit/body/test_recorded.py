"""Recorded folders: what is there is read, what is missing is counted or named in a sentence."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from robot.body.recorded import RecordedBody
from robot.body.recordings import find_recordings, open_recording
from robot.errors import CalibrationError, FrameError, SweeperError
from robot.messages import ImuSample, Scan, Seen, StereoFrame, Tick

MS = 1_000_000
START_NS = 1_403_636_580_000_000_000
WIDTH, HEIGHT = 64, 48
UP = np.array([0.0, -1.0, 0.0])  # of a level camera: its y axis points down
SENSOR = """%YAML:1.0
sensor_type: camera
T_BS:
  cols: 4
  rows: 4
  data: [0, 0, 1, 0.1,
         -1, 0, 0, {y},
         0, -1, 0, 0.0,
         0, 0, 0, 1]
resolution: [64, 48]
camera_model: pinhole
intrinsics: [50.0, 50.0, 31.5, 23.5]
distortion_model: radial-tangential
distortion_coefficients: [0.0, 0.0, 0.0, 0.0]
"""


def image(value: int) -> np.ndarray:
    return np.full((HEIGHT, WIDTH), value, np.uint8)


def make_euroc(root: Path, count: int = 5, suffix: str = ".png", listed: str = ".png") -> Path:
    for eye, (name, y) in enumerate((("cam0", 0.05), ("cam1", -0.05))):
        folder = root / "mav0" / name
        (folder / "data").mkdir(parents=True)
        (folder / "sensor.yaml").write_text(SENSOR.format(y=y))
        rows = ["#timestamp [ns],filename"]
        for k in range(count):
            stamp = START_NS + 100 * MS * k + eye * MS  # the right eye is a millisecond late
            rows.append(f"{stamp},{stamp}{listed}")
            cv2.imwrite(str(folder / "data" / f"{stamp}{suffix}"), image(10 * k + eye))
        (folder / "data.csv").write_text("\n".join(rows) + "\n")
    return root


def add_imu(root: Path, rate_radps: float) -> None:
    """A gyro at 200 Hz whose body z axis points up."""
    folder = root / "mav0" / "imu0"
    folder.mkdir()
    rows = [f"{START_NS + 5 * MS * k},0.0,0.0,{rate_radps},0,0,9.8" for k in range(-4, 100)]
    (folder / "data.csv").write_text("#timestamp,wx,wy,wz,ax,ay,az\n" + "\n".join(rows))


def make_kitti(root: Path, count: int = 5) -> Path:
    for eye in (0, 1):
        folder = root / f"image_{eye}"
        folder.mkdir(parents=True)
        for k in range(count):
            cv2.imwrite(str(folder / f"{k:06d}.png"), image(10 * k + eye))
    (root / "times.txt").write_text("".join(f"{0.1 * k:e}\n" for k in range(count)))
    (root / "calib.txt").write_text(
        "P0: 50 0 31.5 0 0 50 23.5 0 0 0 1 0\nP1: 50 0 31.5 -25 0 50 23.5 0 0 0 1 0\n"
    )
    poses = (f"1 0 0 0 0 1 0 0 0 0 1 {k}" for k in range(count))
    (root / "poses.txt").write_text("\n".join(poses))
    return root


class Watcher:
    """Perception that keeps what it is shown."""

    def __init__(self) -> None:
        self.frames: list[StereoFrame] = []

    def see(self, frame: StereoFrame, arrived_ns: int) -> Seen:
        self.frames.append(frame)
        empty = np.zeros(0)
        return Seen(frame.t_ns, arrived_ns, frame.seq, (), Scan(empty, empty, empty), 1.0)


def live(path: Path) -> tuple[RecordedBody, Watcher, list[object]]:
    watcher = Watcher()
    body = RecordedBody(open_recording(path), watcher, UP)
    return body, watcher, list(body.events())


def test_euroc_frames_come_in_pairs_with_ticks_between(tmp_path: Path) -> None:
    body, watcher, events = live(make_euroc(tmp_path / "run"))
    assert [int(f.left[0, 0]) for f in watcher.frames] == [0, 10, 20, 30, 40]
    assert [int(f.right[0, 0]) for f in watcher.frames] == [1, 11, 21, 31, 41]
    assert [f.t_ns for f in watcher.frames] == [START_NS + 100 * MS * k for k in range(5)]
    assert (body.count.seen, body.count.lost, body.count.reordered) == (5, 0, 0)
    assert len(body.count.read_ms) == 5
    stamps = [event.t_ns for event in events]  # type: ignore[attr-defined]
    assert stamps == sorted(stamps)
    assert sum(isinstance(event, Tick) for event in events) == 21
    assert not any(isinstance(event, ImuSample) for event in events)
    assert all(math.isnan(f.yaw_change_rad) for f in watcher.frames)


@pytest.mark.parametrize("suffix", [".jpg", ".pgm", ".bmp"])
def test_images_may_have_another_extension_than_listed(tmp_path: Path, suffix: str) -> None:
    _, watcher, _ = live(make_euroc(tmp_path / "run", suffix=suffix))
    assert len(watcher.frames) == 5


def test_the_gyro_turns_about_the_robots_up_axis(tmp_path: Path) -> None:
    root = make_euroc(tmp_path / "run")
    add_imu(root, 0.3)
    _, watcher, events = live(root)
    samples = [event for event in events if isinstance(event, ImuSample)]
    assert len(samples) == 21
    assert [s.yaw_rate_radps for s in samples] == pytest.approx([0.3] * 21)
    assert math.isnan(watcher.frames[0].yaw_change_rad)
    assert [f.yaw_change_rad for f in watcher.frames[1:]] == pytest.approx([0.03] * 4)


def test_euroc_calibration_and_truth_are_those_of_the_left_camera(tmp_path: Path) -> None:
    root = make_euroc(tmp_path / "run")
    folder = root / "mav0" / "state_groundtruth_estimate0"
    folder.mkdir()
    (folder / "data.csv").write_text(f"#t,p,q\n{START_NS},1,2,3,0.5,0.5,0.5,0.5,0,0,0\n")
    recording = open_recording(root)
    assert recording.calibration.baseline_m == pytest.approx(0.1)
    assert recording.camera_height_m is None and recording.name == "run"
    # This quaternion turns x to y, y to z and z to x; the camera stands at (0.1, 0.05, 0).
    np.testing.assert_allclose(recording.truth[0, :3, 3], [1.0, 2.1, 3.05])
    np.testing.assert_allclose(recording.truth[0, :3, 2], [0, 1, 0], atol=1e-12)
    assert abs(int(recording.truth_t_ns[0]) - START_NS) < 256


def test_kitti_is_read_with_times_truth_and_height(tmp_path: Path) -> None:
    body, watcher, _ = live(make_kitti(tmp_path / "street"))
    assert [int(f.left[0, 0]) for f in watcher.frames] == [0, 10, 20, 30, 40]
    assert [f.t_ns for f in watcher.frames] == [100 * MS * k for k in range(5)]
    assert body.count.lost == 0
    recording = open_recording(tmp_path / "street")
    assert recording.calibration.baseline_m == pytest.approx(0.5)
    assert recording.camera_height_m == 1.65
    assert recording.truth[:, 2, 3].tolist() == [0, 1, 2, 3, 4]
    assert recording.truth_t_ns[-1] == 400 * MS


def test_colour_images_are_seen_grey(tmp_path: Path) -> None:
    root = make_kitti(tmp_path / "street", 1)
    cv2.imwrite(str(root / "image_0" / "000000.png"), np.full((HEIGHT, WIDTH, 3), 77, np.uint8))
    _, watcher, _ = live(root)
    assert watcher.frames[0].left.shape == (HEIGHT, WIDTH) and watcher.frames[0].left[0, 0] == 77


def test_missing_damaged_and_late_frames_are_counted(tmp_path: Path) -> None:
    root = make_euroc(tmp_path / "run", 8)
    left, right = (root / "mav0" / eye for eye in ("cam0", "cam1"))
    images = sorted((right / "data").iterdir())
    images[1].unlink()  # listed, but gone
    images[2].write_bytes(b"not an image")
    images[3].write_bytes(b"")
    lines = (left / "data.csv").read_text().splitlines()
    lines[6], lines[7] = lines[7], lines[6]  # frames 5 and 6 in the wrong order
    (left / "data.csv").write_text("\n".join(lines))
    rows = (right / "data.csv").read_text().splitlines()
    (right / "data.csv").write_text("\n".join(rows[:-1]))  # the last one was not recorded
    body, watcher, _ = live(root)
    assert [int(f.left[0, 0]) for f in watcher.frames] == [0, 40, 60]
    assert (body.count.seen, body.count.lost, body.count.reordered) == (3, 4, 1)


def test_a_frame_of_the_right_eye_alone_is_lost(tmp_path: Path) -> None:
    root = make_euroc(tmp_path / "run")
    table = root / "mav0" / "cam0" / "data.csv"
    table.write_text(
        "\n".join(line for i, line in enumerate(table.read_text().splitlines()) if i != 3)
    )
    body, watcher, _ = live(root)
    assert (body.count.seen, body.count.lost) == (4, 1)
    assert [int(f.right[0, 0]) for f in watcher.frames] == [1, 11, 31, 41]


def test_a_missing_kitti_image_does_not_shift_the_times(tmp_path: Path) -> None:
    root = make_kitti(tmp_path / "street")
    for eye in (0, 1):
        (root / f"image_{eye}" / "000002.png").unlink()
    body, watcher, _ = live(root)
    assert [f.t_ns for f in watcher.frames] == [0, 100 * MS, 300 * MS, 400 * MS]
    assert body.count.lost == 1


def test_an_excerpt_may_keep_its_image_numbers(tmp_path: Path) -> None:
    root = make_kitti(tmp_path / "street", 3)
    for eye in (0, 1):
        for file in sorted((root / f"image_{eye}").iterdir()):
            file.rename(file.with_stem(f"{int(file.stem) + 700:06d}"))
    _, watcher, _ = live(root)
    assert [f.t_ns for f in watcher.frames] == [0, 100 * MS, 200 * MS]


def test_recordings_are_found_in_a_folder_of_them(tmp_path: Path) -> None:
    a, b = make_euroc(tmp_path / "a", 1), make_kitti(tmp_path / "b", 1)
    (tmp_path / "notes").mkdir()
    assert find_recordings([tmp_path]) == [a, b]
    assert find_recordings([b, a]) == [b, a]
    assert find_recordings([a / "mav0"]) == [a / "mav0"]


def broken(kind: str, root: Path) -> Path:
    if kind == "missing":
        return root / "none"
    if kind == "empty":
        return root
    if kind.startswith("kitti"):
        make_kitti(root)
        if kind == "kitti times":
            (root / "times.txt").unlink()
        elif kind == "kitti short times":
            (root / "times.txt").write_text("0.0\n0.1\n")
        elif kind == "kitti words":
            (root / "times.txt").write_text("soon\nlater\n")
        elif kind == "kitti calib":
            (root / "calib.txt").unlink()
        elif kind == "kitti projection":
            (root / "calib.txt").write_text("P0: 1 2 3\n")
        elif kind == "kitti right":
            for file in (root / "image_1").iterdir():
                file.unlink()
        return root
    make_euroc(root)
    cam0 = root / "mav0" / "cam0"
    if kind == "euroc sensor":
        (cam0 / "sensor.yaml").unlink()
    elif kind == "euroc list":
        (cam0 / "data.csv").unlink()
    elif kind == "euroc stamp":
        (cam0 / "data.csv").write_text("yesterday,a.png\n")
    elif kind == "euroc images":
        for file in (cam0 / "data").iterdir():
            file.unlink()
    elif kind == "euroc imu":
        (root / "mav0" / "imu0").mkdir()
        (root / "mav0" / "imu0" / "data.csv").write_text("1,2,3\n")
    return root


@pytest.mark.parametrize(
    ("kind", "error", "words"),
    [
        ("missing", FrameError, "no such folder"),
        ("empty", FrameError, "neither EuRoC ASL"),
        ("kitti times", FrameError, "list of times is missing"),
        ("kitti short times", FrameError, "2 times for 5 images"),
        ("kitti words", FrameError, "line 1: not 1 numbers"),
        ("kitti calib", CalibrationError, "calibration is missing"),
        ("kitti projection", CalibrationError, "P0"),
        ("kitti right", FrameError, "not one image pair"),
        ("euroc sensor", CalibrationError, "calibration is missing"),
        ("euroc list", FrameError, "list of frames is missing"),
        ("euroc stamp", FrameError, "line 1: not `timestamp"),
        ("euroc images", FrameError, "not one image pair"),
        ("euroc imu", FrameError, "line 1: not 7 numbers"),
    ],
)
def test_what_is_wrong_is_said_in_a_sentence(
    tmp_path: Path, kind: str, error: type[SweeperError], words: str
) -> None:
    with pytest.raises(error) as caught:
        open_recording(broken(kind, tmp_path))
    text = str(caught.value)
    assert words in text and str(tmp_path) in text
    assert "\n" not in text and text.endswith(".")
