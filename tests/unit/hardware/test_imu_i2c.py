"""The gyro drivers against chips that obey their rules at register level."""

import math

import pytest

from robot.errors import HardwareError
from robot.hardware.fakes import FakeI2cBus, FakeIcm20948, FakeIcm42688, FakeMpu6050
from robot.hardware.i2c import open_bus
from robot.hardware.imu_i2c import Imu

CHIPS = {
    "MPU-6050": FakeMpu6050,
    "MPU-6500": lambda: FakeMpu6050(0x70),
    "MPU-9250": lambda: FakeMpu6050(0x71),
    "ICM-42688-P": FakeIcm42688,
    "ICM-20948": FakeIcm20948,
}


class Clock:
    """Time that passes when slept and when told."""

    def __init__(self):
        self.ns = 0

    def __call__(self):
        return self.ns

    def sleep(self, seconds):
        self.ns += round(seconds * 1e9)


@pytest.fixture(params=CHIPS, ids=str)
def built(request):
    chip, clock = CHIPS[request.param](), Clock()
    bus = FakeI2cBus({0x68: chip})
    return Imu(bus, clock=clock, sleep=clock.sleep), chip, bus, clock, request.param


def test_each_chip_is_known_by_its_identity(built):
    imu, _, _, _, name = built
    assert imu.name == name and imu.address == 0x68


@pytest.mark.parametrize("raw", [-32768, -655, -1, 0, 1, 655, 32767])
def test_raw_counts_become_radians_per_second(built, raw):
    imu, chip, _, clock, _ = built
    chip.turn(7, -9, raw)
    clock.ns = 42
    sample = imu.read()
    assert sample.t_ns == 42
    assert sample.yaw_rate_radps == pytest.approx(math.radians(raw / 65.5))


def test_mounting_and_bias_are_taken_into_account():
    chip = FakeMpu6050()
    chip.turn(0, -655, 0)
    imu = Imu(FakeI2cBus({0x69: chip}), axis="-y", bias_radps=0.01, sleep=lambda s: None)
    assert imu.read().yaw_rate_radps == pytest.approx(math.radians(10.0) - 0.01)


def test_a_power_dip_is_noticed_and_the_chip_is_set_up_again(built):
    imu, chip, _, _, _ = built
    chip.turn(0, 0, 655)
    assert imu.read().yaw_rate_radps > 0.1
    chip.power_dip()
    rates = [imu.read().yaw_rate_radps for _ in range(60)]
    assert rates[0] == 0.0
    assert rates[-1] == pytest.approx(math.radians(10.0))


def test_a_silent_chip_costs_samples_and_ever_fewer_transfers(built):
    imu, _, bus, clock, _ = built
    bus.broken = True
    tries = 0
    for _ in range(50 * 60):  # a minute of the control loop
        before = imu.failures
        assert imu.read() is None
        tries += imu.failures - before
        clock.ns += 20_000_000
    assert tries < 25
    assert "does not answer" in imu.problem
    bus.broken = False
    clock.ns += 10_000_000_000
    assert imu.read() is not None
    assert imu.problem == ""


def test_rest_tells_bias_noise_and_which_way_is_up(built):
    imu, chip, _, _, _ = built
    chip.turn(13, -26, 131)
    chip.pull(0, -16384, 0)
    rest = imu.rest(samples=20)
    assert rest.gyro_radps[2] == pytest.approx(math.radians(2.0))
    assert rest.up == "-y"
    assert rest.accel_mps2[1] == pytest.approx(-9.80665)


def shaky(chip, imu):
    """Let the chip's last bit flicker as a living one's does."""
    real, n = chip.read, [0]

    def read(register):
        n[0] += register == chip.gyro + 5
        return real(register) ^ (n[0] % 2 if register == chip.gyro + 5 else 0)

    chip.read = read


def test_the_self_test_accepts_a_living_chip_mounted_right(built):
    imu, chip, _, _, _ = built
    chip.pull(100, -100, 16384)
    chip.turn(50, 20, 30)
    shaky(chip, imu)
    assert imu.self_test() == []


@pytest.mark.parametrize(
    ("pull", "turn", "living", "said"),
    [
        ((0, 0, 16384), (0, 0, 0), False, "does not measure"),
        ((0, 0, 4000), (0, 0, 0), True, "gravity is 2.4"),
        ((-16384, 0, 0), (0, 0, 0), True, "imu_axis = '-x'"),
        ((0, 0, 16384), (0, 0, 6550), True, "rad/s at rest"),
    ],
)
def test_the_self_test_names_what_is_wrong(built, pull, turn, living, said):
    imu, chip, _, _, _ = built
    chip.pull(*pull)
    chip.turn(*turn)
    if living:
        shaky(chip, imu)
    assert any(said in sentence for sentence in imu.self_test())


def test_a_chip_left_in_another_bank_is_found():
    chip = FakeIcm20948()
    chip.registers[0x7F] = 0x20
    assert Imu(FakeI2cBus({0x68: chip}), sleep=lambda s: None).name == "ICM-20948"


def test_a_foreign_chip_is_refused_by_name_and_nothing_is_written_to_it():
    bus = FakeI2cBus({0x68: FakeMpu6050(0x19)})
    with pytest.raises(HardwareError, match=r"0x19.*MPU-6050"):
        Imu(bus)
    assert not [entry for entry in bus.history if entry[0] == "write"]


def test_nothing_on_the_bus_is_explained():
    with pytest.raises(HardwareError, match="i2cdetect"):
        Imu(FakeI2cBus({}))


def test_a_chip_that_keeps_nothing_is_refused():
    chip = FakeMpu6050()
    chip.write = lambda register, value: None
    with pytest.raises(HardwareError, match="cannot be set up"):
        Imu(FakeI2cBus({0x68: chip}), sleep=lambda s: None)


def test_a_missing_bus_names_the_device_and_the_remedy():
    with pytest.raises(HardwareError, match=r"/dev/i2c-29.*dtparam"):
        open_bus(29)
