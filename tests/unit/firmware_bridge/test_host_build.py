"""Finding a compiler, building, and what is said when that fails."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

from firmware_bridge import host
from firmware_bridge.errors import BridgeError
from firmware_bridge.host import HostFirmware, HostInputs, build_host_firmware, find_compiler
from firmware_bridge.messages import ContactBit


def no_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    """Hide every compiler of this computer."""
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr(host.shutil, "which", lambda _: None)


def test_without_any_compiler_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    no_compiler(monkeypatch)
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    with pytest.raises(BridgeError, match="pip install ziglang"):
        find_compiler()


def test_falls_back_to_ziglang(monkeypatch: pytest.MonkeyPatch) -> None:
    no_compiler(monkeypatch)
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: name == "ziglang")
    assert find_compiler() == [sys.executable, "-m", "ziglang", "cc"]


def test_the_environment_chooses_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", f"{sys.executable} -c pass")
    assert find_compiler() == [sys.executable, "-c", "pass"]


def test_a_failing_compiler_is_one_sentence(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(
        host, "find_compiler", lambda: [sys.executable, "-c", "raise SystemExit(1)"]
    )
    with pytest.raises(BridgeError, match="could not build the host firmware"):
        build_host_firmware(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_an_existing_binary_is_not_built_again(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    calls: list[list[str]] = []

    def compile_(command: list[str], **_: object) -> subprocess.CompletedProcess[str]:
        calls.append(command)
        Path(command[-1]).write_text("binary")
        return subprocess.CompletedProcess(command, 0, "", "")

    monkeypatch.setattr(host, "find_compiler", lambda: ["cc"])
    monkeypatch.setattr(host.subprocess, "run", compile_)
    first = build_host_firmware(tmp_path)
    assert build_host_firmware(tmp_path) == first
    assert first.read_text() == "binary"
    assert len(calls) == 1
    assert "-Werror" in calls[0]
    assert build_host_firmware(tmp_path, extra_flags=("-g",)) != first


def test_a_missing_binary_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(BridgeError, match="does not start"):
        HostFirmware(tmp_path / "nothing")


def test_a_program_that_ends_is_one_sentence() -> None:
    with pytest.raises(BridgeError, match="ended by itself"):
        HostFirmware(Path("/bin/false"))


def test_inputs_become_contact_bits() -> None:
    assert HostInputs().contacts() == 0
    everything = HostInputs(0, 0, True, True, True, True, True).contacts()
    assert everything == 0xFF & ~(ContactBit.CLIFF_LEFT | ContactBit.CLIFF_RIGHT)
