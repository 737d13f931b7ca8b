"""The installer, into a folder: idempotent, and never over a person's configuration."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
INSTALLER = ROOT / "deploy" / "install.sh"


def install(*arguments, **environment):
    return subprocess.run(
        [str(INSTALLER), *arguments],
        capture_output=True,
        text=True,
        check=False,
        env={"PATH": "/usr/bin:/bin", "PYTHON": sys.executable, **environment},
    )


def test_an_unknown_option_is_explained():
    result = install("--prefix", "/tmp")
    assert result.returncode == 2 and "--prefix" in result.stderr


def test_the_unit_runs_what_the_installer_puts_in_place():
    unit = (ROOT / "systemd" / "sweeper.service").read_text()
    assert "/opt/sweeper/current/bin/sweeper run --body live" in unit
    assert "ExecStopPost=/opt/sweeper/current/bin/sweeper wheels stop" in unit
    assert "/etc/sweeper/robot.toml" in unit and "/etc/sweeper" in INSTALLER.read_text()


def test_the_shipped_configuration_is_valid():
    from robot.config import load_config

    config = load_config(ROOT / "deploy" / "config" / "robot.toml")
    assert config.link.port == "/dev/sweeper-wheels"


@pytest.mark.long
def test_installing_twice_keeps_the_configuration(tmp_path):
    first = install("--root", str(tmp_path), PIP_OPTIONS="--no-deps")
    assert first.returncode == 0, first.stderr
    settings = tmp_path / "etc" / "sweeper" / "robot.toml"
    settings.write_text("[robot]\ncruise_mps = 0.2\n")
    second = install("--root", str(tmp_path), PIP_OPTIONS="--no-deps")
    assert second.returncode == 0, second.stderr
    assert settings.read_text() == "[robot]\ncruise_mps = 0.2\n"
    command = tmp_path / "opt" / "sweeper" / "current" / "bin" / "sweeper"
    assert command.exists()
    assert command.read_text().startswith("#!/opt/sweeper/releases/")
    assert (tmp_path / "etc" / "systemd" / "system" / "sweeper.service").exists()
    assert (tmp_path / "etc" / "udev" / "rules.d" / "99-sweeper.rules").exists()
