"""Pictures: exact disparity, repeatable noise, and a marker that can be read."""

import subprocess
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from robot.errors import SceneError
from robot.geometry.se2 import SE2
from robot.sim.render_process import RenderProcess
from robot.sim.rig import StereoRig, planar_to_space

VIEWS = [SE2(1.0, 1.2, 0.8), SE2(2.5, 2.0, 1.9), SE2(3.6, 1.2, -0.3), SE2(2.0, 1.3, 0.0)]


@pytest.fixture(scope="module")
def camera():
    from robot.config import CameraConfig

    return CameraConfig().stereo_camera()


@pytest.mark.parametrize("pose", VIEWS, ids=str)
def test_the_right_eye_moved_by_the_true_disparity_is_the_left_eye(flat, perfect, camera, pose):
    frame, disparity = StereoRig(flat, camera, perfect, 1).render(0, 0, pose)
    v, u = np.mgrid[0 : camera.height_px, 0 : camera.width_px].astype(np.float32)
    warped = cv2.remap(frame.right, u - disparity, v, cv2.INTER_LINEAR)
    inside = (u - disparity > 1) & np.isfinite(disparity)
    error = np.abs(warped.astype(float) - frame.left)[inside]
    shuffled = np.abs(np.roll(warped, 9, axis=1).astype(float) - frame.left)[inside]
    assert np.median(error) <= 2.0  # occluded pixels differ, so the median
    assert np.median(error) < 0.5 * np.median(shuffled)


def test_disparity_projects_a_wall_to_where_it_stands(flat, perfect, camera):
    """Looking along +x in the living room at the wall at x = 2.95 between the doors."""
    pose = SE2(2.0, 2.0, 0.0)
    _, disparity = StereoRig(flat, camera, perfect, 1).render(0, 0, pose)
    v = np.arange(60, 110)
    point = camera.base_from_pixel(np.full(50, 160.0), v, disparity[v, 160])
    scene = point @ planar_to_space(pose)[:3, :3].T + planar_to_space(pose)[:3, 3]
    assert np.median(scene[:, 0]) == pytest.approx(2.93, abs=0.03)


def test_the_same_seed_and_frame_give_the_same_noise(flat, config, camera):
    views = [StereoRig(flat, camera, config.sim, 5).render(0, 3, VIEWS[0])[0] for _ in range(2)]
    other = StereoRig(flat, camera, config.sim, 5).render(0, 4, VIEWS[0])[0]
    assert np.array_equal(views[0].left, views[1].left)
    assert np.array_equal(views[0].right, views[1].right)
    assert not np.array_equal(views[0].left, other.left)


@pytest.mark.parametrize("back_m", [0.0, 0.3, 0.7, 1.1, 1.5])
def test_the_dock_marker_can_be_read_on_the_way_to_it(flat, config, camera, back_m):
    frame, _ = StereoRig(flat, camera, config.sim, 2).render(
        0, 0, flat.start @ SE2(-back_m, 0.0, 0.0)
    )
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    _, ids, _ = cv2.aruco.ArucoDetector(dictionary).detectMarkers(frame.left)
    assert ids is not None and ids.ravel().tolist() == [config.robot.dock_marker_id]


def test_the_second_process_draws_the_same_pictures_in_order(flat, config, camera):
    process = RenderProcess("flat", camera, config.sim, 7)
    for seq, pose in enumerate(VIEWS[:2]):
        process.request(10 * seq, seq, pose)
    rig = StereoRig(flat, camera, config.sim, 7)
    for seq, pose in enumerate(VIEWS[:2]):
        frame, disparity = process.result(0.25)
        expected, true_disparity = rig.render(10 * seq, seq, pose)
        assert (frame.t_ns, frame.seq, frame.yaw_change_rad) == (10 * seq, seq, 0.25)
        assert np.array_equal(frame.left, expected.left)
        assert np.array_equal(frame.right, expected.right)
        np.testing.assert_array_equal(disparity, true_disparity)
    process.close()
    process.close()


ORPHAN = """
import time
from robot.config import CameraConfig, SimConfig
from robot.sim.render_process import RenderProcess
if __name__ == "__main__":
    process = RenderProcess("studio", CameraConfig().stereo_camera(), SimConfig(), 1)
    print(process._process.pid, flush=True)
    time.sleep(60)
"""


def test_the_second_process_does_not_outlive_its_parent(tmp_path):
    script = tmp_path / "orphan.py"
    script.write_text(ORPHAN)
    parent = subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, text=True)
    child = int(parent.stdout.readline())
    parent.kill()
    parent.wait()
    parent.stdout.close()
    deadline = time.monotonic() + 30.0
    while is_alive(child) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not is_alive(child)


def is_alive(pid):
    """Whether a process runs; one that only waits to be collected has ended."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_a_renderer_that_has_died_is_reported_in_one_sentence(config, camera):
    process = RenderProcess("studio", camera, config.sim, 1)
    process._process.kill()
    with pytest.raises(SceneError, match=r"renderer's process has ended \(exit code -9\)"):
        process.request(0, 0, SE2())
        process.result()
    process.close()


def test_a_renderer_that_takes_long_to_end_is_not_called_dead(config, camera, monkeypatch):
    """On a machine without time for it, its line breaks long before it has ended."""
    monkeypatch.setattr("robot.sim.render_process.ENDING_S", 0.01)
    process = RenderProcess("studio", camera, config.sim, 1)
    try:
        process._pipe.close()
        with pytest.raises(SceneError, match=r"process is still ending and draws nothing more"):
            process.request(0, 0, SE2())
    finally:
        process.close()
