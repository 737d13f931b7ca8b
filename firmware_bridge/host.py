"""The firmware on this computer: build it, run it, and step it in lock-step with a simulator.

The controller's serial port is a real pseudo-terminal (`HostFirmware.port`); its clock, encoders,
switches and PWM travel over two pipes, one small binary record each way per step.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import shutil
import struct
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from firmware_bridge.errors import BridgeError
from firmware_bridge.messages import ContactBit

SOURCES = Path(__file__).parent / "firmware" / "src"
FLAGS = ("-std=c11", "-O2", "-Wall", "-Wextra", "-Wconversion", "-Werror")
PWM_MAX = 1000
_PORT_NAME_BYTES = 64
_STEP_IN = struct.Struct("<IiiQHhB")
_STEP_OUT = struct.Struct("<hhBBQ")


@dataclass(frozen=True, slots=True)
class HostInputs:
    """What the controller's pins see at the end of a step. Ticks are cumulative."""

    left_ticks: int = 0
    right_ticks: int = 0
    bump_left: bool = False
    bump_right: bool = False
    cliff: bool = False
    wheel_drop: bool = False
    charging: bool = False
    battery_mv: int = 16000
    current_ma: int = 0
    more_contacts: int = 0  # further `ContactBit`s: single cliff sensors

    def contacts(self) -> int:
        """The switches as `ContactBit`s; one cliff stands for the two front sensors."""
        return (
            ContactBit.BUMP_LEFT * self.bump_left
            | ContactBit.BUMP_RIGHT * self.bump_right
            | (ContactBit.CLIFF_FRONT_LEFT | ContactBit.CLIFF_FRONT_RIGHT) * self.cliff
            | ContactBit.WHEEL_DROP * self.wheel_drop
            | ContactBit.CHARGING * self.charging
            | self.more_contacts
        )


@dataclass(frozen=True, slots=True)
class HostOutputs:
    """What the controller does: PWM in -1 to 1 (forward positive), brush and fan in 0 to 1."""

    left_pwm: float
    right_pwm: float
    brush_pwm: float
    fan_pwm: float
    bytes_sent_by_mcu: int


def source_files(board: str = "host") -> list[Path]:
    """The C files of a board, in the order in which their hash is taken."""
    folders = ("core", "wire", f"board/{board}")
    return sorted(path for folder in folders for path in (SOURCES / folder).glob("*.c"))


def build_number(board: str = "host") -> int:
    """32-bit hash of a board's sources and the headers: the firmware's build number."""
    headers = sorted(SOURCES.rglob("*.h"))
    digest = hashlib.sha256(b"".join(p.read_bytes() for p in [*source_files(board), *headers]))
    return int(digest.hexdigest()[:8], 16)


def find_compiler() -> list[str]:
    """The command of a C compiler, the environment's $CC first.

    Raises BridgeError when there is none.
    """
    for name in (os.environ.get("CC", ""), "cc", "gcc", "clang"):
        if name and shutil.which(name.split()[0]):
            return name.split()
    if importlib.util.find_spec("ziglang"):
        return [sys.executable, "-m", "ziglang", "cc"]
    raise BridgeError(
        "no C compiler was found to build the controller's firmware for this computer; "
        "install gcc or clang, or `pip install ziglang`."
    )


def build_host_firmware(build_dir: Path, *, extra_flags: tuple[str, ...] = ()) -> Path:
    """Compile the host firmware into `build_dir`, unless the very same is there already.

    Returns the binary's path. Raises BridgeError when there is no compiler or it fails.
    """
    number = build_number()
    flags_hash = hashlib.sha256(" ".join((*FLAGS, *extra_flags)).encode()).hexdigest()[:8]
    binary = build_dir / f"sweeper-firmware-{number:08x}-{flags_hash}"
    if binary.exists():
        return binary
    build_dir.mkdir(parents=True, exist_ok=True)
    compiler = find_compiler()
    with tempfile.TemporaryDirectory(dir=build_dir) as scratch:
        made = Path(scratch) / "firmware"
        sources = [str(path) for path in source_files()]
        define = [f"-DFIRMWARE_BUILD=0x{number:08x}u", f"-I{SOURCES}"]
        command = [*compiler, *FLAGS, *extra_flags, *define, *sources, "-o", str(made)]
        result = subprocess.run(
            command, capture_output=True, text=True, check=False, process_group=0
        )
        if result.returncode != 0:
            first = (result.stderr.strip().splitlines() or ["no message"])[0]
            raise BridgeError(
                f"{compiler[0]} could not build the host firmware ({first}); set CC to a working "
                "C11 compiler."
            )
        os.replace(made, binary)
    return binary


class HostFirmware:
    """A running host firmware. Raises BridgeError when it does not start or ends by itself.

    `boot` is the number of starts it reports; steps are divided into pieces of `piece_us`.
    """

    def __init__(self, binary: Path, *, boot: int = 1, piece_us: int = 5000) -> None:
        self._start([str(binary), str(boot), str(piece_us)])

    def _start(self, command: list[str]) -> None:
        """Run a board that speaks the records of `step`."""
        try:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                bufsize=0,
                process_group=0,  # Ctrl-C is for whoever drives it; it ends when its stdin does
            )
        except OSError as error:
            raise BridgeError(
                f"{command[0]}: the firmware does not start ({error}); build it again."
            ) from None
        assert self._process.stdin is not None and self._process.stdout is not None
        self._in, self._out = self._process.stdin.fileno(), self._process.stdout.fileno()
        self.port = self._read(_PORT_NAME_BYTES).rstrip(b"\0").decode()

    def step(self, dt_us: int, inputs: HostInputs, bytes_sent: int) -> HostOutputs:
        """Let `dt_us` microseconds pass, at the end of which the pins are `inputs`.

        `bytes_sent` is what the host has written to the port since the start; the firmware reads
        all of it first. Between pieces of a longer step encoder counts are interpolated.
        """
        return self._exchange(self._record(dt_us, inputs, bytes_sent))

    @staticmethod
    def _record(dt_us: int, inputs: HostInputs, bytes_sent: int) -> bytes:
        return _STEP_IN.pack(
            dt_us,
            inputs.left_ticks,
            inputs.right_ticks,
            bytes_sent,
            inputs.battery_mv,
            inputs.current_ma,
            inputs.contacts(),
        )

    def _exchange(self, record: bytes) -> HostOutputs:
        try:
            os.write(self._in, record)
        except OSError:
            raise self._ended() from None
        left, right, brush, fan, sent = _STEP_OUT.unpack(self._read(_STEP_OUT.size))
        return HostOutputs(left / PWM_MAX, right / PWM_MAX, brush / 100.0, fan / 100.0, sent)

    def _read(self, size: int) -> bytes:
        data = os.read(self._out, size)
        while len(data) < size:
            more = os.read(self._out, size - len(data))
            if not more:
                raise self._ended()
            data += more
        return data

    def _ended(self) -> BridgeError:
        code = self._process.wait(timeout=5.0)
        return BridgeError(
            f"the host firmware has ended by itself (exit code {code}); run it again, and if it "
            "ends again build it with `make -C firmware_bridge/firmware sanitize`."
        )

    def close(self) -> None:
        """End the process. May be called again."""
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                stream.close()
        try:
            self._process.wait(timeout=2.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def __enter__(self) -> HostFirmware:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
