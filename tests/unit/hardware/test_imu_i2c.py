"""The gyro driver against a bus that obeys the chip's rules."""

import math

import pytest

from robot.errors import HardwareError
from robot.hardware.fakes import FakeI2cBus
from robot.hardware.imu_i2c import Imu, open_bus


def test_the_chip_is_woken_and_set_to_500_degrees_per_second():
    bus = FakeI2cBus()
    Imu(bus)
    assert ("write", 0x6B, 0x01) in bus.history
    assert ("write", 0x1B, 0x08) in bus.history


@pytest.mark.parametrize("raw", [-32768, -655, -1, 0, 1, 655, 32767])
def test_raw_counts_become_radians_per_second(raw):
    bus = FakeI2cBus()
    imu = Imu(bus, clock=lambda: 42)
    bus.set_yaw_rate_raw(raw)
    sample = imu.read()
    assert sample.t_ns == 42
    assert sample.yaw_rate_radps == pytest.approx(math.radians(raw / 65.5))


def test_a_foreign_chip_is_refused_by_name():
    with pytest.raises(HardwareError, match=r"0x19.*MPU-6050"):
        Imu(FakeI2cBus(identity=0x19))


def test_nothing_on_the_bus_is_explained():
    bus = FakeI2cBus()
    bus.broken = True
    with pytest.raises(HardwareError, match="i2cdetect"):
        Imu(bus)


def test_a_chip_that_falls_silent_costs_samples_not_the_run():
    bus = FakeI2cBus()
    imu = Imu(bus)
    bus.broken = True
    assert imu.read() is None and imu.failures == 1
    bus.broken = False
    assert imu.read() is not None


def test_a_missing_bus_names_the_device_and_the_remedy():
    with pytest.raises(HardwareError, match=r"/dev/i2c-29.*dtparam"):
        open_bus(29)
