"""The battery gauges against chips of 16-bit registers."""

import pytest

from robot.errors import HardwareError
from robot.hardware.battery_i2c import INA219, INA226, BatteryGauge, Pack
from robot.hardware.fakes import FakeGauge, FakeI2cBus


@pytest.fixture(params=[INA219, INA226], ids=lambda g: g.name)
def built(request):
    kind = request.param
    chip = FakeGauge(kind.reset_config, 0x5449 if kind is INA226 else 0)
    now_ns = [0]
    gauge = BatteryGauge(
        FakeI2cBus({0x40: chip}), pack=Pack(4, 2.0, 0.1), shunt_ohm=0.01, clock=lambda: now_ns[0]
    )
    return gauge, chip, kind, now_ns


def apply(chip, kind, volts, amperes):
    chip.words[0x02] = round(volts / kind.volts_per_lsb) << kind.bus_shift
    chip.words[0x01] = round(amperes * 0.01 / kind.shunt_volts_per_lsb) & 0xFFFF


def test_each_gauge_is_known_and_set_up(built):
    gauge, chip, kind, _ = built
    assert gauge.name == kind.name
    assert chip.words[0x00] == kind.config


@pytest.mark.parametrize(("volts", "amperes"), [(14.8, 1.2), (16.4, 0.0), (12.4, -2.0)])
def test_voltage_and_current_are_read_back(built, volts, amperes):
    gauge, chip, kind, _ = built
    apply(chip, kind, volts, amperes)
    assert gauge.read().voltage_v == pytest.approx(volts, abs=0.005)
    assert gauge.current_a == pytest.approx(amperes, abs=0.002)


def test_charge_starts_at_the_resting_voltage_and_counts_amperes(built):
    gauge, chip, kind, now_ns = built
    apply(chip, kind, 4 * 3.76 - 0.1 * 2.0, 2.0)  # 2 A through 0.1 ohm hide 0.2 V
    assert gauge.read().charge_pct == pytest.approx(55.0, abs=1.0)
    for second in range(1, 361):  # 6 minutes at 2 A of 2 Ah: 10 %
        now_ns[0] = second * 10**9
        reading = gauge.read()
    assert reading.charge_pct == pytest.approx(45.0, abs=1.0)


def test_at_rest_the_voltage_corrects_the_count(built):
    gauge, chip, kind, now_ns = built
    apply(chip, kind, 4 * 4.06, 0.0)
    assert gauge.read().charge_pct == pytest.approx(90.0, abs=1.0)
    apply(chip, kind, 4 * 3.68, 0.05)
    for second in range(1, 3600, 5):
        now_ns[0] = second * 10**9
        reading = gauge.read()
    assert reading.charge_pct == pytest.approx(40.0, abs=2.0)


def test_charge_stays_between_empty_and_full(built):
    gauge, chip, kind, now_ns = built
    apply(chip, kind, 16.8, -30.0)
    for second in range(0, 3600, 60):
        now_ns[0] = second * 10**9
        assert 0.0 <= gauge.read().charge_pct <= 100.0


def test_a_power_dip_costs_one_reading(built):
    gauge, chip, kind, _ = built
    apply(chip, kind, 15.0, 1.0)
    assert gauge.read() is not None
    chip.power_dip()
    assert gauge.read() is None
    assert gauge.read() is not None
    assert chip.words[0x00] == kind.config


def test_a_silent_gauge_is_left_alone_ever_longer(built):
    gauge, _, _, now_ns = built
    gauge._bus.broken = True
    for second in range(60):
        now_ns[0] = second * 10**9
        assert gauge.read() is None
    assert "does not answer" in gauge.problem
    assert gauge._patience.failures < 22


def test_an_unconnected_sense_pin_is_told(built):
    gauge, chip, kind, _ = built
    apply(chip, kind, 0.9, 0.0)
    assert "sensors.cells" in gauge.self_test()[0]
    apply(chip, kind, 15.0, 0.0)
    assert gauge.self_test() == []


def test_a_foreign_chip_and_an_empty_bus_are_refused():
    with pytest.raises(HardwareError, match=r"0x1234.*sensors\.gauge"):
        BatteryGauge(FakeI2cBus({0x40: FakeGauge(0x1234)}), pack=Pack(), shunt_ohm=0.01)
    with pytest.raises(HardwareError, match=r"0x40: no battery gauge"):
        BatteryGauge(FakeI2cBus({}), pack=Pack(), shunt_ohm=0.01)
