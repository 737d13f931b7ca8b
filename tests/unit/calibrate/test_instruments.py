"""Mounting, wheels, synchronisation, and the configuration's lines: numbers from data."""

import math
import tomllib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.calibrate.apply import set_keys
from robot.calibrate.mounting import find_mounting
from robot.calibrate.sync import LightWatch, measure_sync
from robot.calibrate.wheels import Straight, Turn, calibrate_wheels
from robot.config import Config
from robot.errors import CalibrationError, ConfigError

CAMERA = Config().camera.stereo_camera()


def floor(z_m, pitch_rad, roll_rad, rng, wall_share=0.3):
    """Disparity of a floor with noise, holes, and a wall over part of it."""
    u, v = np.meshgrid(np.arange(CAMERA.width_px), np.arange(CAMERA.height_px))
    normal = np.array([
        math.sin(roll_rad),
        math.cos(roll_rad) * math.cos(pitch_rad),
        math.cos(roll_rad) * math.sin(pitch_rad),
    ])  # fmt: skip
    rays = np.stack(
        [(u - CAMERA.cx_px), (v - CAMERA.cy_px), np.full(u.shape, CAMERA.focal_px)], axis=-1
    )
    d = CAMERA.baseline_m / z_m * (rays @ normal)
    d += rng.normal(0.0, 0.3, d.shape)
    d[d < 1.0] = np.nan
    d[rng.random(d.shape) < 0.3] = np.nan
    d[:, : int(wall_share * CAMERA.width_px)] = 14.0
    return d.astype(np.float32)


@settings(max_examples=12, deadline=None)
@given(st.floats(0.05, 0.3), st.floats(-0.1, 0.35), st.floats(-0.06, 0.06), st.integers(0, 99))
def test_height_pitch_and_roll_come_back(z_m, pitch_rad, roll_rad, seed):
    maps = [floor(z_m, pitch_rad, roll_rad, np.random.default_rng(seed + k)) for k in range(2)]
    found = find_mounting(maps, CAMERA)
    assert found.z_m == pytest.approx(z_m, rel=0.03)
    assert found.pitch_rad == pytest.approx(pitch_rad, abs=0.01)
    assert found.roll_rad == pytest.approx(roll_rad, abs=0.01)


def test_a_wall_is_no_floor():
    wall = np.full((CAMERA.height_px, CAMERA.width_px), 12.0, np.float32)
    with pytest.raises(CalibrationError, match="no floor in front"):
        find_mounting([wall], CAMERA)
    with pytest.raises(CalibrationError, match="newspaper"):
        find_mounting([np.full_like(wall, np.nan)], CAMERA)


@given(
    st.floats(0.00016, 0.00024), st.floats(0.19, 0.27), st.floats(-0.04, 0.04),
    st.floats(-0.1, 0.1),
)  # fmt: skip
def test_wheels_come_back_even_if_the_straight_drive_bends(scale, width, imbalance, bend):
    left_m, right_m = 1.0 - width * bend / 2, 1.0 + width * bend / 2
    per_left, per_right = scale * (1 - imbalance / 2), scale * (1 + imbalance / 2)
    straight = Straight(round(left_m / per_left), round(right_m / per_right), 1.0, bend)
    turned = 12.6
    half = turned * width / 2
    turn = Turn(-round(half / per_left), round(half / per_right), turned)
    found = calibrate_wheels(straight, turn, 0.0002, 0.23)
    assert found.metres_per_tick == pytest.approx(scale, rel=0.002)
    assert found.track_width_m == pytest.approx(width, rel=0.003)
    assert found.imbalance == pytest.approx(imbalance, abs=0.002)


@pytest.mark.parametrize(
    ("straight", "turn", "said"),
    [
        (Straight(500, 500, 0.1, 0.0), Turn(-1000, 1000, 12.0), "at least 0.5 m"),
        (Straight(-5000, -5000, 1.0, 0.0), Turn(-1000, 1000, 12.0), "count up"),
        (Straight(5000, 5000, 1.0, 0.0), Turn(-6900, 6900, -12.0), "gyro's sign"),
        (Straight(5000, 5000, 2.0, 0.0), Turn(-6900, 6900, 12.0), "link.metres_per_tick"),
        (Straight(5000, 5000, 1.0, 0.0), Turn(-3000, 3000, 12.0), "robot.track_width_m"),
        (Straight(5000, 5600, 1.0, 0.0), Turn(-6900, 6900, 12.0), "differ by"),
    ],
)
def test_impossible_drives_are_explained(straight, turn, said):
    with pytest.raises(CalibrationError, match=said):
        calibrate_wheels(straight, turn, 0.0002, 0.23)


def watched(offset_ms, blink_hz=23.0, pairs=600, frame_ms=101.7):
    """Brightness of a blinking light in two eyes, the right one exposed later."""
    t_ms = np.arange(pairs) * frame_ms
    period_ms = 1000.0 / blink_hz
    levels = []
    for late_ms in (0.0, offset_ms):
        lit = ((t_ms + late_ms) % period_ms) < period_ms / 2
        levels.append(np.where(lit, 220.0, 30.0))
    return levels


@pytest.mark.parametrize("offset_ms", [0.0, 1.0, 5.0, 9.0])
def test_the_offset_between_the_eyes_is_measured(offset_ms):
    found = measure_sync(*watched(offset_ms), blink_hz=23.0)
    assert found.offset_ms == pytest.approx(offset_ms, abs=max(3.0 * found.sigma_ms, 0.5))
    assert found.synchronised == (offset_ms <= 1.0)


def test_the_light_is_found_in_the_picture():
    rng = np.random.default_rng(1)
    left, _ = watched(0.0, pairs=120)
    watch = LightWatch()
    for level in left:
        image = rng.integers(60, 70, (60, 80)).astype(np.uint8)
        image[30:42, 50:62] = level
        watch.add(image)
    assert np.allclose(watch.levels(), left, atol=1.0)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda lights: [x[:50] for x in lights], "too few"),
        (lambda lights: [lights[0], np.full(600, 80.0)], "right eye sees no blinking"),
        (lambda lights: [np.where(np.arange(600) % 8, 220.0, 30.0)] * 2, "keep step"),
    ],
)
def test_what_cannot_be_measured_is_explained(change, said):
    with pytest.raises(CalibrationError, match=said):
        measure_sync(*change(watched(0.0)), blink_hz=23.0)


TOML = """\
# my robot
[camera]
device = "/dev/video0"  # the good one
z_m = 0.08

[link]
port = "/dev/sweeper-wheels"
"""


def test_values_are_entered_and_everything_else_stays():
    changed = set_keys(
        TOML, {"camera.z_m": 0.095, "camera.pitch_rad": 0.1, "sensors.imu_axis": "-y"}
    )
    assert tomllib.loads(changed) == {
        "camera": {"device": "/dev/video0", "z_m": 0.095, "pitch_rad": 0.1},
        "link": {"port": "/dev/sweeper-wheels"},
        "sensors": {"imu_axis": "-y"},
    }
    assert "# my robot" in changed and "# the good one" in changed
    assert set_keys(changed, {"camera.z_m": 0.095}) == changed


def test_an_empty_file_gets_its_section():
    assert tomllib.loads(set_keys("", {"camera.z_m": 0.1})) == {"camera": {"z_m": 0.1}}


def test_what_would_be_no_configuration_is_refused():
    with pytest.raises(ConfigError, match="zm"):
        set_keys(TOML, {"camera.zm": 1.0})
    with pytest.raises(ConfigError, match="z_m"):
        set_keys(TOML, {"camera.z_m": -1.0})
