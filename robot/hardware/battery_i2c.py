"""The battery gauge: a Texas Instruments INA219 or INA226 on I2C, across a shunt.

Registers from "INA219" SBOS448G and "INA226" SBOS547B. The current is computed here from the shunt
voltage: the chips' own current register needs a calibration that a power dip would clear.

The charge counts amperes; while little current flows it is drawn towards what the resting voltage
of lithium-ion cells says, so that neither the start value nor the drift matters for long.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from robot.errors import HardwareError
from robot.hardware.i2c import I2cBus, Patience, signed16
from robot.messages import Battery

ADDRESS = 0x40
_CONFIG, _SHUNT, _BUS, _MAKER = 0x00, 0x01, 0x02, 0xFE
_RESET = 0x8000
# Resting voltage of one lithium-ion cell and its charge: the usual curve of a graphite NMC cell.
CELL_V = (3.00, 3.30, 3.45, 3.55, 3.62, 3.68, 3.76, 3.85, 3.95, 4.06, 4.18)
CELL_PCT = (0, 4, 8, 16, 28, 40, 55, 68, 79, 90, 100)
_REST_A = 0.3  # below, the terminals show the resting voltage well enough
_PULL_S = 300.0  # time constant towards it


@dataclass(frozen=True, slots=True)
class Gauge:
    """One chip: value of its reset configuration, ours, and what a count means."""

    name: str
    reset_config: int
    config: int
    volts_per_lsb: float  # of the bus voltage
    bus_shift: int
    shunt_volts_per_lsb: float


# 32 V, 320 mV, 128 averages of 12 bits, continuous (SBOS448G tables 4 to 6).
INA219 = Gauge("INA219", 0x399F, 0x3FFF, 4e-3, 3, 10e-6)
# 64 averages of 1.1 ms, continuous (SBOS547B tables 6 to 9).
INA226 = Gauge("INA226", 0x4127, 0x4727, 1.25e-3, 0, 2.5e-6)


@dataclass(frozen=True, slots=True)
class Pack:
    """The battery itself."""

    cells: int = 4
    capacity_ah: float = 2.6
    internal_ohm: float = 0.12


class BatteryGauge:
    """Voltage, current and charge, read on demand. Current flows out of the battery if positive.

    Raises HardwareError when no known gauge answers.
    """

    def __init__(
        self,
        bus: I2cBus,
        *,
        pack: Pack,
        shunt_ohm: float,
        address: int = ADDRESS,
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self._bus, self._address, self._clock = bus, address, clock
        self._pack, self._shunt_ohm = pack, shunt_ohm
        self._patience = Patience(lambda: clock() / 1e9)
        self._charge_pct = math.nan
        self._last_ns = 0
        self.current_a = math.nan
        try:
            self._gauge = self._identify()
            self._write(_CONFIG, self._gauge.config)
        except OSError as error:
            if isinstance(error, HardwareError):
                raise
            raise HardwareError(
                f"I2C address {address:#x}: no battery gauge answers ({error}); connect an INA219 "
                "or INA226, or set sensors.gauge = 'none'."
            ) from None
        self.name = self._gauge.name

    @property
    def problem(self) -> str:
        """Why there is no reading now; empty while there is one."""
        return f"the battery gauge ({self.name}) does not answer" if self._patience.lost else ""

    def read(self) -> Battery | None:
        """The present state; None when the chip did not answer."""
        if not self._patience.may_try():
            return None
        try:
            if self._read(_CONFIG) != self._gauge.config:  # a power dip has reset it
                self._write(_CONFIG, self._gauge.config)
                self._patience.failed()
                return None
            volts = (self._read(_BUS) >> self._gauge.bus_shift) * self._gauge.volts_per_lsb
            shunt = self._read(_SHUNT)
        except OSError:
            self._patience.failed()
            return None
        self._patience.answered()
        now_ns = self._clock()
        self.current_a = (
            signed16(shunt >> 8, shunt & 0xFF) * self._gauge.shunt_volts_per_lsb / self._shunt_ohm
        )
        self._count(now_ns, volts)
        return Battery(now_ns, volts, self._charge_pct)

    def self_test(self) -> list[str]:
        """What is wrong, in sentences; empty: nothing."""
        battery = self.read()
        if battery is None:
            return [f"the {self.name} does not answer; check its wiring."]
        low, high = (limit * self._pack.cells for limit in (2.5, 4.35))
        if not low < battery.voltage_v < high:
            return [
                f"the battery shows {battery.voltage_v:.1f} V where {self._pack.cells} cells have "
                f"{low:.0f} to {high:.0f} V; check V+ of the {self.name} and sensors.cells."
            ]
        return []

    def _count(self, now_ns: int, volts: float) -> None:
        resting_v = (volts + self.current_a * self._pack.internal_ohm) / self._pack.cells
        by_voltage = float(np.interp(resting_v, CELL_V, CELL_PCT))
        if math.isnan(self._charge_pct):
            self._charge_pct = by_voltage
        else:
            passed_s = (now_ns - self._last_ns) / 1e9
            used_ah = self.current_a * passed_s / 3600.0
            charge = self._charge_pct - 100.0 * used_ah / self._pack.capacity_ah
            if abs(self.current_a) < _REST_A:
                charge += (by_voltage - charge) * min(1.0, passed_s / _PULL_S)
            self._charge_pct = min(100.0, max(0.0, charge))
        self._last_ns = now_ns

    def _identify(self) -> Gauge:
        self._write(_CONFIG, _RESET)
        found = self._read(_CONFIG)
        if found == INA219.reset_config:
            return INA219
        if found == INA226.reset_config and self._read(_MAKER) == 0x5449:  # "TI"
            return INA226
        raise HardwareError(
            f"I2C address {self._address:#x}: register 0 is {found:#06x} after a reset, which is "
            "no INA219 or INA226; set sensors.gauge_address, or sensors.gauge = 'none'."
        )

    def _read(self, register: int) -> int:
        high, low = self._bus.read_i2c_block_data(self._address, register, 2)
        return high << 8 | low

    def _write(self, register: int, value: int) -> None:
        self._bus.write_i2c_block_data(self._address, register, [value >> 8, value & 0xFF])
