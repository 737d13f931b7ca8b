"""Stand-ins that obey the hardware's rules and remember what was done to them."""

from __future__ import annotations

import struct
from collections.abc import Iterable

from robot.messages import StereoFrame


class FakeBuzzer:
    """Hears every beep."""

    def __init__(self) -> None:
        self.beeps: list[int] = []  # times

    def beep(self, now_ns: int) -> None:
        """Remember when."""
        self.beeps.append(now_ns)


class FakeChip:
    """A device of byte registers; unset ones read 0, as after power-up."""

    def __init__(self, power_up: dict[int, int]) -> None:
        self._power_up = dict(power_up)
        self.registers = dict(power_up)

    def power_dip(self) -> None:
        """All registers are as at power-up again."""
        self.registers = dict(self._power_up)

    def read(self, register: int) -> int:
        """One byte."""
        return self.registers.get(register, 0)

    def write(self, register: int, value: int) -> None:
        """One byte."""
        self.registers[register] = value


class FakeMpu6050(FakeChip):
    """An IMU of the MPU family: asleep at first; asleep, it measures nothing."""

    accel, gyro = 0x3B, 0x43

    def __init__(self, identity: int = 0x68) -> None:
        super().__init__({0x75: identity, 0x6B: 0x40})
        self._world: dict[int, int] = {}

    def turn(self, x: int, y: int, z: int) -> None:
        """Turn the chip: raw counts of its three gyros."""
        self._set(self.gyro, x, y, z)

    def pull(self, x: int, y: int, z: int) -> None:
        """Accelerate the chip: raw counts of its three accelerometers."""
        self._set(self.accel, x, y, z)

    def _set(self, register: int, *raw: int) -> None:
        data = struct.pack(">hhh", *raw)
        self._world.update({register + k: byte for k, byte in enumerate(data)})

    def _awake(self) -> bool:
        return not self.registers[0x6B] & 0x40

    def read(self, register: int) -> int:
        """Measured registers are 0 while the chip sleeps."""
        if register in self._world:
            return self._world[register] if self._awake() else 0
        return super().read(register)


class FakeIcm42688(FakeMpu6050):
    """Its sensors are off at first; its bank 0 is where everything is."""

    accel, gyro = 0x1F, 0x25

    def __init__(self) -> None:
        super().__init__()
        self._power_up = {0x75: 0x47, 0x4F: 0x06, 0x50: 0x06}
        self.power_dip()

    def _awake(self) -> bool:
        return self.registers.get(0x4E, 0) & 0x0F == 0x0F and self.registers.get(0x76, 0) == 0


class FakeIcm20948(FakeMpu6050):
    """Four banks behind the same addresses: registers are known by bank and number."""

    accel, gyro = 0x2D, 0x33

    def __init__(self) -> None:
        super().__init__()
        self._power_up = {0x00: 0xEA, 0x06: 0x41, 0x201: 0x01}
        self.power_dip()

    def _place(self, register: int) -> int:
        bank = self.registers.get(0x7F, 0) >> 4
        return register if register == 0x7F else bank << 8 | register

    def _awake(self) -> bool:
        return not self.registers[0x06] & 0x40

    def read(self, register: int) -> int:
        """Of the selected bank."""
        return super().read(self._place(register))

    def write(self, register: int, value: int) -> None:
        """Of the selected bank."""
        super().write(self._place(register), value)


class FakeGauge:
    """An INA219 or INA226: 16-bit registers, high byte first; bit 15 of register 0 resets."""

    def __init__(self, reset_config: int, maker: int = 0) -> None:
        self._reset_config = reset_config
        self.words = {0x00: reset_config, 0xFE: maker}

    def power_dip(self) -> None:
        """The configuration is as at power-up again."""
        self.words[0x00] = self._reset_config

    def read_word(self, register: int) -> int:
        """The register as an unsigned number."""
        return self.words.get(register, 0)

    def write_word(self, register: int, value: int) -> None:
        """Measured and identity registers keep their value, as in the chip."""
        if register == 0x00:
            self.words[0x00] = self._reset_config if value & 0x8000 else value


class FakeI2cBus:
    """An I2C bus with devices at addresses; nobody answers elsewhere.

    `broken` makes every transfer fail; `history` holds (what, address, register, value or length).
    """

    def __init__(self, devices: dict[int, FakeChip | FakeGauge]) -> None:
        self.devices = devices
        self.history: list[tuple[str, int, int, int]] = []
        self.broken = False

    def read_byte_data(self, i2c_addr: int, register: int) -> int:
        """Read one register."""
        return self.read_i2c_block_data(i2c_addr, register, 1)[0]

    def write_byte_data(self, i2c_addr: int, register: int, value: int) -> None:
        """Write one register; a value that is no byte is refused as the driver does."""
        self.write_i2c_block_data(i2c_addr, register, [value])

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> list[int]:
        """Read consecutive registers, or one word of a gauge."""
        device = self._answer(i2c_addr)
        self.history.append(("read", i2c_addr, register, length))
        if isinstance(device, FakeGauge):
            return list(struct.pack(">H", device.read_word(register)))[:length]
        return [device.read(register + k) for k in range(length)]

    def write_i2c_block_data(self, i2c_addr: int, register: int, data: list[int]) -> None:
        """Write consecutive registers, or one word of a gauge."""
        device = self._answer(i2c_addr)
        if not all(0 <= value <= 255 for value in data):
            raise ValueError("not a byte")
        self.history.append(("write", i2c_addr, register, data[0]))
        if isinstance(device, FakeGauge):
            device.write_word(register, data[0] << 8 | data[1])
        else:
            for k, value in enumerate(data):
                device.write(register + k, value)

    def _answer(self, address: int) -> FakeChip | FakeGauge:
        if self.broken or address not in self.devices:
            raise OSError(121, "Remote I/O error")
        return self.devices[address]


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
