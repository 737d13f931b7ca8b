"""The gyro (and, for its self-test, the accelerometer) of an InvenSense IMU on I2C.

Registers from "MPU-6000 and MPU-6050 Register Map" rev. 4.2, "ICM-42688-P Datasheet" DS-000347
rev. 1.6 (section 13) and "ICM-20948 Datasheet" DS-000189 rev. 1.3 (sections 7 to 10). All are set
to 500 degrees/s and 2 g, big-endian, with a low pass near 50 Hz; none stretches the clock.

A chip that stops answering, or that a power dip has put back to sleep, costs samples: it is set up
again when it answers again, and the robot goes on without a gyro, degraded.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from robot.errors import HardwareError
from robot.hardware.i2c import I2cBus, Patience, signed16
from robot.messages import ImuSample

ADDRESSES = (0x68, 0x69)
G_MPS2 = 9.80665
_RADPS_PER_LSB = math.radians(1.0 / 65.5)  # at the 500 degrees/s range
_MPS2_PER_LSB = G_MPS2 / 16384.0  # at the 2 g range
_LOOK_EVERY = 50  # samples between two looks whether the chip is still set up
_GYRO_START_S = 0.05


@dataclass(frozen=True, slots=True)
class Chip:
    """What one family needs: how to know it, its set-up in order, and where its numbers are."""

    name: str
    who_register: int
    identity: int
    setup: tuple[tuple[int, int], ...]
    awake: tuple[int, int]  # a register that a reset changes, and its value after the set-up
    accel_register: int  # six bytes: x, y, z
    gyro_register: int


def _mpu(name: str, identity: int) -> Chip:
    # Wake up on the gyro's clock; 42 Hz low pass; 1 kHz / 5; 500 degrees/s; 2 g.
    setup = ((0x6B, 0x01), (0x1A, 0x03), (0x19, 0x04), (0x1B, 0x08), (0x1C, 0x00))
    return Chip(name, 0x75, identity, setup, (0x1B, 0x08), 0x3B, 0x43)


CHIPS = (
    _mpu("MPU-6050", 0x68),
    _mpu("MPU-6500", 0x70),
    _mpu("MPU-9250", 0x71),
    Chip(
        "ICM-42688-P",
        0x75,
        0x47,
        # Bank 0; 500 degrees/s and 2 g at 200 Hz; both sensors on, low noise (last: section 12.9).
        ((0x76, 0x00), (0x4F, 0x47), (0x50, 0x67), (0x4E, 0x0F)),
        (0x4E, 0x0F),
        0x1F,
        0x25,
    ),
    Chip(
        "ICM-20948",
        0x00,
        0xEA,
        # Bank 0: wake up, best clock. Bank 2: 1125 Hz / 5, 500 degrees/s and 2 g with low pass 3.
        (
            (0x7F, 0x00), (0x06, 0x01), (0x7F, 0x20), (0x00, 0x04), (0x01, 0x1B), (0x14, 0x19),
            (0x7F, 0x00),
        ),
        (0x06, 0x01),
        0x2D,
        0x33,
    ),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class AtRest:
    """What a resting IMU says: mean turn rate (3,) in rad/s, its noise, mean acceleration (3,)."""

    gyro_radps: np.ndarray
    noise_radps: np.ndarray
    accel_mps2: np.ndarray

    @property
    def up(self) -> str:
        """The chip's axis that points up, such as "z" or "-x"."""
        k = int(np.argmax(np.abs(self.accel_mps2)))
        return ("" if self.accel_mps2[k] > 0.0 else "-") + "xyz"[k]


class Imu:
    """Turn rate about the vertical, read on demand.

    `axis` is the chip's axis that points up; `bias_radps` is taken off. Raises HardwareError when
    no known chip answers on the bus.
    """

    def __init__(
        self,
        bus: I2cBus,
        *,
        axis: str = "z",
        bias_radps: float = 0.0,
        clock: Callable[[], int] = time.monotonic_ns,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._bus, self._clock, self._sleep = bus, clock, sleep
        self._index, self._sign = "xyz".index(axis[-1]), -1.0 if axis.startswith("-") else 1.0
        self._bias_radps = bias_radps
        self._patience = Patience(lambda: clock() / 1e9)
        self._reads = 0
        self.address, self._chip = self._find()
        self.name = self._chip.name
        self._set_up()

    @property
    def failures(self) -> int:
        """Reads that brought nothing, since the start."""
        return self._patience.failures

    @property
    def problem(self) -> str:
        """Why there is no turn rate now; empty while there is one."""
        return f"the gyro ({self.name}) does not answer" if self._patience.lost else ""

    def read(self) -> ImuSample | None:
        """The present turn rate; None when the chip did not answer."""
        if not self._patience.may_try():
            return None
        try:
            if self._patience.lost or self._reads % _LOOK_EVERY == 0:
                self._wake()
            self._reads += 1
            register = self._chip.gyro_register + 2 * self._index
            high, low = self._bus.read_i2c_block_data(self.address, register, 2)
        except OSError:
            self._patience.failed()
            return None
        self._patience.answered()
        rate = self._sign * signed16(high, low) * _RADPS_PER_LSB
        return ImuSample(self._clock(), rate - self._bias_radps)

    def rest(self, samples: int = 100, period_s: float = 0.01) -> AtRest:
        """Listen for a while, the robot standing still. Raises HardwareError if it falls silent."""
        gyro, accel = np.empty((samples, 3)), np.empty((samples, 3))
        try:
            for k in range(samples):
                gyro[k] = self._triple(self._chip.gyro_register, _RADPS_PER_LSB)
                accel[k] = self._triple(self._chip.accel_register, _MPS2_PER_LSB)
                self._sleep(period_s)
        except OSError as error:
            raise HardwareError(
                f"I2C address {self.address:#x}: the {self.name} fell silent ({error}); "
                "check its wiring."
            ) from None
        noise = np.where(np.ptp(gyro, axis=0) > 0.0, gyro.std(axis=0), 0.0)
        return AtRest(gyro.mean(axis=0), noise, accel.mean(axis=0))

    def self_test(self) -> list[str]:
        """What is wrong with a chip at rest, in sentences; empty: nothing."""
        rest = self.rest()
        wrong = []
        gravity = float(np.linalg.norm(rest.accel_mps2))
        if not np.any(rest.noise_radps > 0.0):
            wrong.append(f"the {self.name} always says the same: it does not measure; replace it.")
        elif not 0.85 * G_MPS2 < gravity < 1.15 * G_MPS2:
            wrong.append(f"gravity is {gravity:.1f} m/s2 at rest; keep still, or replace the IMU.")
        elif rest.up != ("-" if self._sign < 0 else "") + "xyz"[self._index]:
            wrong.append(
                f"the chip's {rest.up} axis points up; set sensors.imu_axis = '{rest.up}', or "
                "mount it as configured."
            )
        worst = float(np.max(np.abs(rest.gyro_radps)))
        if worst > math.radians(20.0):  # the data sheets allow the worst chip so much
            wrong.append(f"it turns by {worst:.2f} rad/s at rest; keep still, or replace the IMU.")
        return wrong

    # ------------------------------------------------------------------ parts

    def _find(self) -> tuple[int, Chip]:
        answers: list[str] = []
        for address in ADDRESSES:
            for register in (0x75, 0x00):
                try:
                    identity = self._bus.read_byte_data(address, register)
                except OSError as error:
                    answers.append(f"{address:#x}: {error}")
                    break
                if register == 0x00 and identity != 0xEA:
                    identity = self._in_bank_0(address, identity)
                for chip in CHIPS:
                    if (chip.who_register, chip.identity) == (register, identity):
                        return address, chip
                answers.append(f"{address:#x}: register {register:#x} is {identity:#x}")
        known = ", ".join(chip.name for chip in CHIPS)
        raise HardwareError(
            f"no gyro on the I2C bus ({'; '.join(answers).replace('; ', ', ')}); connect one of "
            f"{known}, and look with `i2cdetect -y 1`."
        )

    def _in_bank_0(self, address: int, identity: int) -> int:
        """An ICM-20948 that was left in bank 2 shows another register there (DS-000189, 7)."""
        try:
            if self._bus.read_byte_data(address, 0x7F) != 0x20:
                return identity
            self._bus.write_byte_data(address, 0x7F, 0x00)
            return self._bus.read_byte_data(address, 0x00)
        except OSError:
            return identity

    def _set_up(self) -> None:
        try:
            for register, value in self._chip.setup:
                self._bus.write_byte_data(self.address, register, value)
            self._sleep(_GYRO_START_S)
            self._wake()
        except OSError as error:
            raise HardwareError(
                f"I2C address {self.address:#x}: the {self.name} cannot be set up ({error}); "
                "check its wiring and its supply of 3.3 V."
            ) from None

    def _wake(self) -> None:
        """Set it up again if something has reset it. The next samples may still read 0."""
        register, value = self._chip.awake
        if self._bus.read_byte_data(self.address, register) != value:
            for key, setting in self._chip.setup:
                self._bus.write_byte_data(self.address, key, setting)
            if self._bus.read_byte_data(self.address, register) != value:
                raise OSError(5, "it does not keep its settings")

    def _triple(self, register: int, scale: float) -> list[float]:
        data = self._bus.read_i2c_block_data(self.address, register, 6)
        return [scale * signed16(data[k], data[k + 1]) for k in (0, 2, 4)]
