"""`sweeper calibrate imu | wheels | camera-pose | sync`, with fakes for the machine."""

import json
import math
import sys
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from robot.body.calibration import sensors as calibrate_sensors
from robot.cli import main
from robot.config import load_config
from robot.hardware.fakes import FakeI2cBus, FakeMpu6050
from robot.hardware.imu_i2c import Imu


@pytest.fixture
def toml(tmp_path):
    path = tmp_path / "robot.toml"
    path.write_text('# mine\n[link]\nport = "/dev/x"\n')
    return path


def chip(turn=(0, 0, 20), pull=(0, 0, 16384), alive=True):
    made = FakeMpu6050()
    made.turn(*turn)
    made.pull(*pull)
    if alive:
        real, count = made.read, [0]

        def read(register):
            count[0] += register % 2
            return real(register) ^ (count[0] % 7 & 1 if register in (0x44, 0x46, 0x48) else 0)

        made.read = read
    return made


def use_imu(monkeypatch, made):
    monkeypatch.setattr(
        calibrate_sensors,
        "open_imu",
        lambda config: Imu(
            FakeI2cBus({0x68: made}), axis=config.sensors.imu_axis, sleep=lambda s: None
        ),
    )


def test_imu_enters_bias_and_axis(monkeypatch, toml):
    use_imu(monkeypatch, chip(turn=(40, 0, 0), pull=(-16384, 0, 0)))
    report = toml.with_name("report.json")
    assert main(["calibrate", "imu", "--config", str(toml), "--apply", "--json", str(report)]) == 0
    config = load_config(toml)
    assert config.sensors.imu_axis == "-x"
    assert config.sensors.imu_bias_radps == pytest.approx(-math.radians(40 / 65.5), rel=0.05)
    assert "# mine" in toml.read_text()
    assert json.loads(report.read_text())["axis"] == "-x"


def test_imu_refuses_a_chip_that_does_not_measure(monkeypatch, toml, capsys):
    use_imu(monkeypatch, chip(alive=False))
    assert main(["calibrate", "imu", "--config", str(toml), "--apply"]) == 2
    assert "scatters by 0.0000" in capsys.readouterr().err
    assert load_config(toml).sensors.imu_bias_radps == 0.0


def test_apply_needs_a_file_to_change(monkeypatch, capsys):
    use_imu(monkeypatch, chip())
    assert main(["calibrate", "imu", "--apply"]) == 2
    assert "--apply needs --config" in capsys.readouterr().err


class Robot:
    """A controller whose wheels roll, and the world's clock; also the gyro on it."""

    def __init__(self, metres_per_tick=0.00021, track_width_m=0.24, latch_after_s=None):
        self.scale, self.width, self.latch_after_s = metres_per_tick, track_width_m, latch_after_s
        self.ns, self.left_m, self.right_m, self.rate, self.driven_s = 0, 0.0, 0.0, 0.0, 0.0
        self.stopped = self.closed = False
        self.link = SimpleNamespace(
            stop_reason=SimpleNamespace(name="BUMP"), close=lambda: setattr(self, "closed", True)
        )

    def connect(self):
        pass

    def clear(self):
        return True

    def latched(self):
        return self.latch_after_s is not None and self.driven_s > self.latch_after_s

    def stop(self):
        self.stopped = True

    def ticks(self):
        return round(self.left_m / self.scale), round(self.right_m / self.scale)

    def wait(self, seconds, order=None, until=None):
        for _ in range(round(seconds * 50)):
            if until is not None and until():
                return True
            left, right = (order.left_mm_s, order.right_mm_s) if order else (0, 0)
            self.driven_s += 0.02 * bool(left or right)
            self.left_m += left / 1000 * 0.02
            self.right_m += right / 1000 * 0.02
            self.rate = (right - left) / 1000 / self.width
            self.ns += 20_000_000
        return False

    def read(self):
        return SimpleNamespace(t_ns=self.ns, yaw_rate_radps=self.rate + 0.03)


def use_robot(monkeypatch, robot):
    monkeypatch.setattr("robot.body.wheels._open", lambda config, port="": robot)
    monkeypatch.setattr(calibrate_sensors, "open_imu", lambda config: robot)


def test_wheels_learn_scale_and_track(monkeypatch, toml):
    robot = Robot()
    use_robot(monkeypatch, robot)
    metres = "0.996"  # 8.3 s at 0.12 m/s, as the wheels roll true
    assert main(
        ["calibrate", "wheels", "--config", str(toml), "--yes", "--measured-m", metres, "--apply"]
    ) == 0  # fmt: skip
    config = load_config(toml)
    assert config.link.metres_per_tick == pytest.approx(0.00021, rel=0.01)
    assert config.robot.track_width_m == pytest.approx(0.24, rel=0.02)
    assert robot.stopped and robot.closed


def test_a_drive_that_is_cut_short_ends_with_a_stop(monkeypatch, toml, capsys):
    robot = Robot(latch_after_s=2.0)
    use_robot(monkeypatch, robot)
    assert main(["calibrate", "wheels", "--yes", "--measured-m", "1"]) == 2
    assert "cut short ('bump')" in capsys.readouterr().err
    assert robot.stopped and robot.closed


def test_wheels_ask_before_they_turn(monkeypatch, capsys):
    monkeypatch.setattr(sys, "stdin", open("/dev/null"))  # noqa: SIM115
    assert main(["calibrate", "wheels"]) == 2
    assert "not confirmed" in capsys.readouterr().err


def lit(folder, offset, pairs=120):
    for n in range(pairs):
        for side, late in (("left", 0.0), ("right", offset)):
            image = np.full((30, 40), 60, np.uint8)
            on = (n * 101.7 + late) % 40.0 < 20.0
            image[10:20, 15:25] = 220 if on else 40
            cv2.imwrite(str(folder / f"{side}{n}.png"), image)


def test_sync_judges_recorded_pairs(tmp_path, capsys):
    lit(tmp_path, 0.0)
    base = ["calibrate", "sync", "--blink-hz", "25", "--frames", str(tmp_path)]
    assert main(base) == 0
    lit(tmp_path, 9.0)
    assert main(base) == 2
    assert "synchronisation line" in capsys.readouterr().err


def test_camera_pose_sees_the_floor_through_the_matcher(tmp_path, toml):
    camera = load_config(toml).camera.stereo_camera()
    u, v = np.meshgrid(np.arange(320.0), np.arange(240.0))
    z_m, pitch = 0.12, 0.2
    disparity = (
        camera.baseline_m
        / z_m
        * ((v - camera.cy_px) * math.cos(pitch) + camera.focal_px * math.sin(pitch))
    )
    disparity = np.clip(disparity, 0.5, 60.0)
    noise = np.random.default_rng(1).integers(0, 255, (240, 500)).astype(np.uint8)
    wide = cv2.GaussianBlur(noise, (0, 0), 1.2)
    left = cv2.normalize(wide, None, 0, 255, cv2.NORM_MINMAX)
    # The left eye shows at u what the right one shows at u - disparity.
    shown = cv2.remap(left, (u - disparity + 100).astype(np.float32), v.astype(np.float32), 1)
    cv2.imwrite(str(tmp_path / "left0.png"), shown)
    cv2.imwrite(str(tmp_path / "right0.png"), left[:, 100:420])
    assert main(
        ["calibrate", "camera-pose", "--config", str(toml), "--frames", str(tmp_path), "--apply"]
    ) == 0  # fmt: skip
    found = load_config(toml).camera
    assert found.z_m == pytest.approx(z_m, rel=0.03)
    assert found.pitch_rad == pytest.approx(pitch, abs=0.02)


def test_a_board_is_drawn_for_the_printer(tmp_path, capsys):
    out = tmp_path / "board.png"
    assert main(["calibrate", "board", "--board", "chess:4x3:20mm", "--out", str(out)]) == 0
    picture = cv2.imread(str(out), 0)
    assert abs(picture.shape[1] - 7 * 20 / 25.4 * 300) < 7  # five squares and two margins
    assert main(["calibrate", "board", "--out", str(tmp_path / "none" / "b.png")]) == 2
