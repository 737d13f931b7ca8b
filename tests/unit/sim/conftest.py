"""The flat, built once for all tests of the simulator."""

import pytest

from robot.config import Config, SimConfig
from robot.sim.scene import load_scene

PERFECT = SimConfig(
    wheel_scale_error=0.0, motor_mismatch=0.0, encoder_noise=0.0, slip_every_s=0.0,
    gyro_bias_radps=0.0, gyro_walk=0.0, gyro_noise_radps=0.0, image_noise=0.0,
    exposure_difference=0.0, vertical_shift_px=0.0, vignetting=0.0,
)  # fmt: skip


@pytest.fixture(scope="session")
def flat():
    return load_scene("flat")


@pytest.fixture
def perfect():
    return PERFECT


@pytest.fixture
def config():
    return Config()
