"""The I2C bus: opened so that a transfer cannot block, and rested when its devices fail."""

from __future__ import annotations

import fcntl
import time
from collections.abc import Callable
from typing import Protocol

from robot.errors import HardwareError

_I2C_RETRIES, _I2C_TIMEOUT = 0x0701, 0x0702  # ioctl numbers of linux/i2c-dev.h
_TIMEOUT_10MS = 2  # the kernel's default is a second: fifty beats of the control loop
FAILURES_BEFORE_REST = 5
FIRST_REST_S, LONGEST_REST_S = 0.1, 5.0


class I2cBus(Protocol):
    """The part of `smbus2.SMBus` that is used."""

    def read_byte_data(self, i2c_addr: int, register: int) -> int: ...

    def write_byte_data(self, i2c_addr: int, register: int, value: int) -> None: ...

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> list[int]: ...

    def write_i2c_block_data(self, i2c_addr: int, register: int, data: list[int]) -> None: ...


def open_bus(number: int) -> I2cBus:
    """Open /dev/i2c-`number` with a short timeout. Raises HardwareError with the remedy."""
    from smbus2 import SMBus

    try:
        bus = SMBus(number)
        assert bus.fd is not None
        for request, value in ((_I2C_TIMEOUT, _TIMEOUT_10MS), (_I2C_RETRIES, 0)):
            fcntl.ioctl(bus.fd, request, value)
    except OSError as error:
        raise HardwareError(
            f"/dev/i2c-{number}: {error.strerror or error}; enable I2C with "
            "`dtparam=i2c_arm=on` in /boot/firmware/config.txt and add the user to group i2c."
        ) from None
    return bus


class Patience:
    """When to ask a device that fails: at once, and after a row of failures ever more rarely.

    So a dead sensor costs the control loop a bounded and vanishing share of its time.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._row = 0
        self._rest_s, self._next_s = FIRST_REST_S, 0.0
        self.failures = 0

    @property
    def lost(self) -> bool:
        """The device has failed so often in a row that it counts as gone."""
        return self._row >= FAILURES_BEFORE_REST

    def may_try(self) -> bool:
        """Is it time to ask?"""
        return not self.lost or self._clock() >= self._next_s

    def failed(self) -> None:
        """It did not answer."""
        self.failures += 1
        self._row += 1
        if self.lost:
            self._next_s = self._clock() + self._rest_s
            self._rest_s = min(2.0 * self._rest_s, LONGEST_REST_S)

    def answered(self) -> None:
        """It did."""
        self._row, self._rest_s = 0, FIRST_REST_S


def signed16(high: int, low: int) -> int:
    """Two bytes, the high one first, as a signed number."""
    value = high << 8 | low
    return value - 65536 if value & 0x8000 else value
