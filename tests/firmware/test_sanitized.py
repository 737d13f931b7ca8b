"""Lives of the whole bridge with a firmware that ends at its first bad access or overflow."""

from __future__ import annotations

from pathlib import Path

import noise_trials
import pytest
from conftest import UNDEFINED
from firmware_rig import Rig

from firmware_bridge.errors import BridgeError
from firmware_bridge.host import build_host_firmware


@pytest.fixture(scope="module")
def sanitized(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Address and undefined-behaviour sanitizers."""
    flags = ("-g", "-O1", "-fsanitize=address", *UNDEFINED)
    try:
        return build_host_firmware(tmp_path_factory.mktemp("sanitized"), extra_flags=flags)
    except BridgeError as error:
        pytest.skip(f"the compiler has no sanitizers: {error}")


@pytest.mark.parametrize("share", [0.01, 0.2])
def test_noise(sanitized: Path, share: float) -> None:
    report = noise_trials.at_share(sanitized, share, 40_000)
    assert report["hurt"] > 0.7 * share * 40_000


def test_every_length_and_the_wrap_of_the_clock(sanitized: Path) -> None:
    with Rig(sanitized, piece_us=1_000_000) as rig:
        rig.firmware.step(2**32 - 300_000, rig.inputs, 0)
        rig.arm()
        for size in range(1, 300):
            rig.write(bytes([size % 255 + 1]) * size + b"\0")
            rig.step()
        rig.drive(300, -300, 600)
        rig.travel_m = [2**31 / 5000.0, -(2**31) / 5000.0]
        rig.drive(300, -300, 600)
