"""Put an image into the controller with avrdude, and see that it answers as the new one."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from firmware_bridge.errors import BridgeError
from firmware_bridge.live import Live
from firmware_bridge.messages import Board, HelloAck

BOOTLOADER_BAUDS = (115200, 57600)  # the second one is the older Nano's


@dataclass(frozen=True, slots=True)
class Flashed:
    """What was done: `before` is None when no Sweeper firmware answered."""

    before: HelloAck | None
    after: HelloAck | None
    written: bool


def identify(live: Live, board: Board) -> HelloAck | None:
    """Who answers now, if anybody does.

    Raises BridgeError for a controller of another kind: this image is not for it.
    """
    try:
        who = live.connect()
    except BridgeError:
        return None
    if who.board != board:
        raise BridgeError(
            f"the controller is board {who.board} and the image is for board {int(board)} "
            f"({board.name}); connect the right one."
        )
    return who


def check_image(image: Path) -> None:
    """Is it a whole Intel HEX file? Raises BridgeError when not (Intel, "Hexadecimal Object File
    Format Specification", 1988: the bytes of every record add up to 0, the last one is type 1)."""
    try:
        lines = image.read_text(encoding="ascii").split()
        records = [bytes.fromhex(line.removeprefix(":")) for line in lines]
        whole = bool(lines) and all(line.startswith(":") for line in lines)
        whole = whole and all(len(r) == r[0] + 5 and sum(r) % 256 == 0 for r in records)
        whole = whole and records[-1][3] == 1
    except (OSError, ValueError, IndexError):
        whole = False
    if not whole:
        raise BridgeError(f"{image} is no complete Intel HEX file; build it with `make avr`.")


def write(image: Path, port: str, bauds: tuple[int, ...] = BOOTLOADER_BAUDS) -> None:
    """Write and verify the .hex through the board's boot loader.

    Raises BridgeError when avrdude is missing or fails at every speed.
    """
    avrdude = shutil.which("avrdude")
    if avrdude is None:
        raise BridgeError("avrdude is missing; apt-get install avrdude.")
    said = ""
    for baud in bauds:
        command = [avrdude, "-q", "-p", "atmega328p", "-c", "arduino", "-P", port, "-b", str(baud)]
        command += ["-D", "-U", f"flash:w:{image}:i"]
        result = subprocess.run(command, capture_output=True, text=True, check=False)
        if result.returncode == 0:
            return
        said = (result.stderr.strip().splitlines() or ["no message"])[-1]
    raise BridgeError(
        f"avrdude could not write {image} at {port} ({said}); remove the capacitor at RESET, or "
        "press the board's reset button as it starts."
    )


def flash(
    open_live: Callable[[], Live],
    image: Path,
    build: int | None,
    port: str,
    *,
    board: Board = Board.ATMEGA328P,
    force: bool = False,
    confirm: Callable[[str], bool],
) -> Flashed:
    """Write `image`, whose build number is `build` (None: unknown), unless it runs already.

    `open_live` opens a fresh link at `port`; it is closed before avrdude takes the port. Raises
    BridgeError when it is refused, fails, or another firmware answers afterwards.
    """
    check_image(image)
    live = open_live()
    try:
        before = identify(live, board)
        if before is not None:
            live.stop()
    finally:
        live.link.close()
    if before is not None and before.build == build and not force:
        return Flashed(before, before, False)
    runs = "none of Sweeper's" if before is None else f"build {before.build:08x}"
    new = "of unknown build" if build is None else f"build {build:08x}"
    if not confirm(f"{port} runs {runs}; write {image.name}, {new}?"):
        raise BridgeError("flashing was not confirmed; say `yes` at the robot, or pass --yes.")
    write(image, port)
    live = open_live()
    try:
        after = live.connect()
    finally:
        live.link.close()
    if build is not None and after.build != build:
        raise BridgeError(
            f"the controller answers as build {after.build:08x} and not {build:08x}; flash again."
        )
    return Flashed(before, after, True)
