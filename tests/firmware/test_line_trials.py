"""Orders over a bad line, in C and by the million: none that was never sent is carried out."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from firmware_bridge.board import make
from firmware_bridge.errors import BridgeError
from firmware_bridge.host import SOURCES


@pytest.fixture(scope="module")
def line_trials(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The program of firmware/fuzz/line_trials.c."""
    folder = tmp_path_factory.mktemp("line")
    try:
        make("line-trials", folder, "install make and a C compiler")
    except BridgeError as error:
        pytest.skip(str(error))
    return folder / "line-trials"


def run(program: Path, *arguments: int | str) -> dict[str, int]:
    """Its counters; it must end well."""
    result = subprocess.run(
        [str(program), *map(str, arguments)], capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stdout + result.stderr
    print(result.stdout)
    return {name: int(count) for count, name in re.findall(r"(\d+) (\w+)", result.stdout)}


@pytest.mark.parametrize("ppm", [1_000, 10_000, 50_000, 200_000])
def test_no_wrong_order_in_ten_million_bytes(line_trials: Path, ppm: int) -> None:
    counts = run(line_trials, "noise", ppm, 10**7, 1)
    assert counts["bytes"] >= 10**7
    assert counts["hurt"] == pytest.approx(10 * ppm, rel=0.05)
    assert counts["orders"] > 1000
    assert counts["wrong"] == 0


@pytest.mark.parametrize("burst_ms", [50, 200, 500, 1000, 2000])
def test_no_wrong_order_in_bursts(line_trials: Path, burst_ms: int) -> None:
    counts = run(line_trials, "bursts", burst_ms, 10**7, 2)
    assert counts["orders"] > 100_000
    assert counts["hurt"] > 100_000
    assert counts["wrong"] == 0


def test_no_order_without_a_session(line_trials: Path) -> None:
    assert run(line_trials, "random", 10**6, 3)["orders"] == 0


@pytest.mark.long
@pytest.mark.timeout(7200)
def test_no_order_without_a_session_in_a_billion_frames(line_trials: Path) -> None:
    assert run(line_trials, "random", 10**9, 4)["orders"] == 0


def test_the_trials_would_notice(line_trials: Path, tmp_path: Path) -> None:
    """With the CRC unchecked wrong orders do get through."""
    root = tmp_path / "firmware"
    shutil.copytree(SOURCES.parent, root, ignore=shutil.ignore_patterns("build"))
    frame = root / "src" / "wire" / "frame.c"
    text = frame.read_text(encoding="utf-8")
    assert text.count("if (same) {") == 1
    frame.write_text(text.replace("if (same) {", "if (same || (crc != 0u)) {"), encoding="utf-8")
    subprocess.run(["make", "-C", str(root), "line-trials"], check=True, capture_output=True)
    command = [str(root / "build" / "line-trials"), "noise", "10000", "1000000", "1"]
    assert subprocess.run(command, capture_output=True, check=False).returncode == 1


@pytest.mark.skipif(shutil.which("clang") is None, reason="clang (libFuzzer) is missing")
def test_the_fuzzer_finds_nothing_in_a_short_run(tmp_path: Path) -> None:
    command = ["make", "-C", str(SOURCES.parent), f"BUILD={tmp_path}", "FUZZ_SECONDS=4", "fuzz"]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    if "fuzzer" in result.stderr and "cannot find" in result.stderr:
        pytest.skip("clang has no libFuzzer: install libclang-rt-dev")
    assert result.returncode == 0, result.stderr[-2000:]
    runs = re.search(r"number_of_executed_units: (\d+)", result.stderr)
    assert runs is not None and int(runs[1]) > 1000
