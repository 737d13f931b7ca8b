"""Stand-ins that obey the hardware's rules and remember what was done to them."""

from __future__ import annotations

import struct
from collections.abc import Iterable

from robot.messages import StereoFrame


class FakeI2cBus:
    """An I2C bus with one MPU-6050: registers hold what was written; the gyro sleeps at first."""

    def __init__(self, address: int = 0x68, identity: int = 0x68) -> None:
        self._address = address
        self._registers = {0x75: identity, 0x6B: 0x40}
        self.history: list[tuple[str, int, int]] = []
        self.broken = False

    def set_yaw_rate_raw(self, raw: int) -> None:
        """Turn the chip: the value of GYRO_ZOUT while it is awake."""
        self._registers[0x47], self._registers[0x48] = struct.pack(">h", raw)

    def read_byte_data(self, address: int, register: int) -> int:
        """Read one register; unset ones read 0, as after power-up."""
        self._answer(address)
        self.history.append(("read", register, 1))
        return self._registers.get(register, 0)

    def write_byte_data(self, address: int, register: int, value: int) -> None:
        """Write one register; a value that is no byte is refused as the driver does."""
        self._answer(address)
        if not 0 <= value <= 255:
            raise ValueError("not a byte")
        self.history.append(("write", register, value))
        self._registers[register] = value

    def read_i2c_block_data(self, address: int, register: int, length: int) -> list[int]:
        """Read consecutive registers; a sleeping chip measures nothing."""
        self._answer(address)
        self.history.append(("read", register, length))
        if self._registers[0x6B] & 0x40:
            return [0] * length
        return [self._registers.get(register + i, 0) for i in range(length)]

    def _answer(self, address: int) -> None:
        if self.broken or address != self._address:
            raise OSError(121, "Remote I/O error")


class FakeStereo:
    """A camera that delivers given frames, then stops; reading it closed is a mistake."""

    def __init__(self, frames: Iterable[StereoFrame]) -> None:
        self._frames = iter(frames)
        self.reads = 0
        self.closed = False

    def read(self) -> StereoFrame | None:
        """The next frame, or None when there is no more."""
        if self.closed:
            raise ValueError("the camera is closed")
        self.reads += 1
        return next(self._frames, None)

    def close(self) -> None:
        """Give the device back."""
        self.closed = True
