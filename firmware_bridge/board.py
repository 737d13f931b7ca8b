"""The ATmega328P image: build it, measure it, and run it on an emulated board.

`EmulatedFirmware` is driven as `HostFirmware` is, but executes the very image that is flashed, with
its interrupts, timers, ADC and UART; time is the controller's own (simavr counts its cycles).
"""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

from firmware_bridge.errors import BridgeError
from firmware_bridge.host import SOURCES, HostFirmware, HostInputs

FLASH_BYTES, RAM_BYTES = 32256, 2048  # without the boot loader's 512 bytes
_HANG_US = 0xFFFFFFFF
_POWER_CYCLE_US = 0xFFFFFFFE
_BLIND_US = 0xFFFFFFFD
_STACK_US = 0xFFFFFFFC
_TOOLS = "apt-get install make gcc-avr avr-libc binutils-avr"
_EMULATOR_TOOLS = "apt-get install build-essential libsimavr-dev libelf-dev"


@dataclass(frozen=True, slots=True)
class Size:
    """Bytes that an image takes: flash, and RAM without the stack."""

    flash: int
    ram: int


def make(target: str, build_dir: Path, remedy: str) -> None:
    """Run the firmware's Makefile. Raises BridgeError with `remedy` when that fails."""
    folder = SOURCES.parent
    command = ["make", "-C", str(folder), f"BUILD={build_dir.resolve()}", target]
    try:
        result = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError:
        raise BridgeError(f"`make` is missing; {remedy}.") from None
    if result.returncode != 0:
        lines = [line for line in result.stderr.splitlines() if "rror" in line]
        first = (lines or ["no message"])[0].strip()
        raise BridgeError(f"`make -C {folder} {target}` failed ({first}); {remedy}.")


def build_image(build_dir: Path) -> Path:
    """Build the ATmega328P image into `build_dir`; returns the ELF, with the .hex beside it.

    Raises BridgeError when the AVR compiler is missing or fails.
    """
    if shutil.which("avr-gcc") is None:
        raise BridgeError(f"the AVR compiler avr-gcc is missing; {_TOOLS}.")
    make("avr", build_dir, _TOOLS)
    return build_dir / "atmega328p.elf"


def image_size(image: Path) -> Size:
    """Flash and RAM that the ELF takes."""
    text = subprocess.run(
        ["avr-size", str(image)], capture_output=True, text=True, check=True
    ).stdout
    code, data, bss = map(int, re.findall(r"\d+", text.splitlines()[1])[:3])
    return Size(code + data, data + bss)


def symbol_address(image: Path, name: str) -> int:
    """Byte address of a function in the image. Raises BridgeError when it has none."""
    text = subprocess.run(["avr-nm", str(image)], capture_output=True, text=True, check=True).stdout
    for line in text.splitlines():
        address, _, symbol = line.split()
        if symbol == name:
            return int(address, 16)
    raise BridgeError(f"{image} holds no function {name}; build it again.")


def build_emulator(build_dir: Path) -> Path:
    """Build the emulated board. Raises BridgeError when simavr is missing."""
    make("emulator", build_dir, _EMULATOR_TOOLS)
    return build_dir / "emulated-board"


class EmulatedFirmware(HostFirmware):
    """A running image on the emulated board; `trace` keeps the cycles at which `function` ran."""

    def __init__(
        self, emulator: Path, image: Path, *, function: str = "", trace: Path | None = None
    ) -> None:
        command = [str(emulator), str(image)]
        if trace is not None:
            command += [hex(symbol_address(image, function)), str(trace)]
        self._start(command)

    def hang(self) -> None:
        """Lead the program into an endless loop, as a fault would; interrupts go on."""
        self._exchange(self._record(_HANG_US, HostInputs(), 0))

    def power_cycle(self) -> None:
        """Reset the controller; its EEPROM stays."""
        self._exchange(self._record(_POWER_CYCLE_US, HostInputs(), 0))

    def blind(self) -> None:
        """End the interrupts of the ADC: its last samples stay for ever."""
        self._exchange(self._record(_BLIND_US, HostInputs(), 0))

    def stack_bytes(self) -> int:
        """How deep the stack has been since the start."""
        return self._exchange(self._record(_STACK_US, HostInputs(), 0)).bytes_sent_by_mcu
