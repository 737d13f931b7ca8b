"""The gyro: an InvenSense MPU-6050, 6500 or 9250 on I2C.

Registers from "MPU-6000 and MPU-6050 Register Map and Descriptions", revision 4.2. The z axis of
the chip points up. A sensor that stops answering is reported once and then simply stays silent:
the robot goes on without a gyro, degraded.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Protocol

from robot.errors import HardwareError
from robot.messages import ImuSample

ADDRESS = 0x68
_WHO_AM_I, _KNOWN = 0x75, {0x68: "MPU-6050", 0x70: "MPU-6500", 0x71: "MPU-9250"}
_PWR_MGMT_1, _CLOCK_FROM_GYRO = 0x6B, 0x01
_CONFIG, _LOW_PASS_42_HZ = 0x1A, 0x03
_GYRO_CONFIG, _RANGE_500_DPS = 0x1B, 0x08
_GYRO_ZOUT_H = 0x47
_RADPS_PER_LSB = math.radians(1.0 / 65.5)  # at the 500 degrees/s range


class I2cBus(Protocol):
    """The part of `smbus2.SMBus` that is used."""

    def read_byte_data(self, address: int, register: int) -> int: ...

    def write_byte_data(self, address: int, register: int, value: int) -> None: ...

    def read_i2c_block_data(self, address: int, register: int, length: int) -> list[int]: ...


def open_bus(number: int) -> I2cBus:
    """Open /dev/i2c-`number`. Raises HardwareError with the remedy."""
    from smbus2 import SMBus

    try:
        return SMBus(number)
    except OSError as error:
        raise HardwareError(
            f"/dev/i2c-{number}: {error.strerror or error}; enable I2C with "
            "`dtparam=i2c_arm=on` in /boot/firmware/config.txt and add the user to group i2c."
        ) from None


class Imu:
    """Turn rate about z, read on demand."""

    def __init__(self, bus: I2cBus, clock: Callable[[], int] = time.monotonic_ns) -> None:
        self._bus = bus
        self._clock = clock
        self.failures = 0
        try:
            identity = bus.read_byte_data(ADDRESS, _WHO_AM_I)
            if identity not in _KNOWN:
                raise HardwareError(
                    f"I2C address {ADDRESS:#x}: WHO_AM_I is {identity:#x}, not a known gyro; "
                    f"connect one of {', '.join(_KNOWN.values())}."
                )
            bus.write_byte_data(ADDRESS, _PWR_MGMT_1, _CLOCK_FROM_GYRO)
            bus.write_byte_data(ADDRESS, _CONFIG, _LOW_PASS_42_HZ)
            bus.write_byte_data(ADDRESS, _GYRO_CONFIG, _RANGE_500_DPS)
        except OSError as error:
            if isinstance(error, HardwareError):
                raise
            raise HardwareError(
                f"I2C address {ADDRESS:#x}: no gyro answers ({error}); check its wiring with "
                "`i2cdetect -y 1`."
            ) from None
        self.name = _KNOWN[identity]

    def read(self) -> ImuSample | None:
        """The present turn rate; None when the chip did not answer."""
        try:
            high, low = self._bus.read_i2c_block_data(ADDRESS, _GYRO_ZOUT_H, 2)
        except OSError:
            self.failures += 1
            return None
        raw = (high << 8 | low) - (65536 if high & 0x80 else 0)
        return ImuSample(self._clock(), raw * _RADPS_PER_LSB)
