"""The host firmware, built once per session, and a rig around it."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from firmware_rig import Rig, emulated_rig

from firmware_bridge.board import build_emulator, build_image
from firmware_bridge.errors import BridgeError
from firmware_bridge.host import build_host_firmware, find_compiler

UNDEFINED = ("-fsanitize=undefined", "-fno-sanitize-recover=all")


@pytest.fixture(scope="session")
def firmware_binary(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The binary, which ends at the first undefined behaviour; skipped without a C compiler.

    `SWEEPER_TEST_FIRMWARE` names another one, which is how mutants are tried.
    """
    if given := os.environ.get("SWEEPER_TEST_FIRMWARE"):
        return Path(given)
    try:
        find_compiler()
    except BridgeError as error:
        pytest.skip(str(error))
    folder = tmp_path_factory.mktemp("firmware")
    try:
        return build_host_firmware(folder, extra_flags=UNDEFINED)
    except BridgeError:  # no runtime library for that
        return build_host_firmware(folder)


@pytest.fixture(scope="session")
def emulated_board(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Emulator and ATmega328P image; the tests are skipped where simavr or avr-gcc is missing."""
    folder = tmp_path_factory.mktemp("board")
    try:
        return build_emulator(folder), build_image(folder)
    except BridgeError as error:
        pytest.skip(f"simavr or avr-gcc is missing: {error}")


@pytest.fixture
def emulated(emulated_board: tuple[Path, Path]) -> Iterator[Rig]:
    """The real image on an emulated board with geared motors, armed."""
    with emulated_rig(emulated_board) as made:
        made.arm()
        yield made


@pytest.fixture
def rig(firmware_binary: Path) -> Iterator[Rig]:
    """A firmware that has just started."""
    with Rig(firmware_binary) as made:
        yield made


@pytest.fixture
def armed(rig: Rig) -> Rig:
    """A firmware with an open session and nothing latched."""
    rig.arm()
    return rig
