"""Install, update, trial, rollback and removal, in a folder that stands for the card."""

import importlib.util
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[3]
spec = importlib.util.spec_from_file_location("manage", REPOSITORY / "deploy/manage.py")
manage = importlib.util.module_from_spec(spec)
spec.loader.exec_module(manage)


@pytest.fixture(autouse=True)
def hurry(monkeypatch):
    """Nothing here outlives the test: the disk need not be waited for."""
    monkeypatch.setattr(os, "fsync", lambda descriptor: None)


def source(tmp_path, version="0.1.0", name="source"):
    """As much of a checkout as is installed, with a version of its own."""
    folder = tmp_path / name
    for part in ("deploy", "systemd"):
        shutil.copytree(REPOSITORY / part, folder / part, dirs_exist_ok=True)
    (folder / "robot").mkdir(exist_ok=True)
    (folder / "robot/__init__.py").write_text(f'__version__ = "{version}"\n')
    (folder / "pyproject.toml").write_text(f'[project]\nname = "sweeper"\nversion = "{version}"\n')
    return folder


def build(origin, folder):
    """Stands for the virtual environment: a program that says its version."""
    (folder / "bin").mkdir(parents=True)
    with open(folder / "bin/sweeper", "wb") as file:
        file.write(b"#!/bin/sh\necho " + (origin / "robot/__init__.py").read_bytes())


@pytest.fixture
def root(tmp_path):
    made = tmp_path / "card"
    (made / "boot/firmware").mkdir(parents=True)
    (made / "boot/firmware/config.txt").write_text("# Pi\narm_64bit=1\n\n[pi4]\narm_boost=1\n")
    return made


def run(root, *words, build=build):
    return manage.main([*map(str, words), "--root", str(root)], build)


def status(root, capsys):
    capsys.readouterr()
    assert run(root, "status") == 0
    return json.loads(capsys.readouterr().out)


def files(root):
    return {
        str(p.relative_to(root)): os.readlink(p) if p.is_symlink() else p.read_bytes()
        for p in sorted(root.rglob("*"))
        if p.is_file() or p.is_symlink()
    }


def test_install_twice_changes_nothing_the_second_time(tmp_path, root, capsys):
    origin = source(tmp_path)
    assert run(root, "install", origin) == 0
    once = files(root)
    assert run(root, "install", origin) == 0
    assert files(root) == once
    assert status(root, capsys)["current"].startswith("0.1.0-")
    assert "etc/systemd/system/sweeper.service" in once
    assert "etc/udev/rules.d/99-sweeper.rules" in once
    assert "opt/sweeper/current" in once
    assert (root / "opt/sweeper/current/bin/sweeper").is_file()


def test_the_owners_settings_are_never_overwritten(tmp_path, root):
    (root / "etc/sweeper").mkdir(parents=True)
    (root / "etc/sweeper/robot.toml").write_text("# mine\n")
    run(root, "install", source(tmp_path))
    assert (root / "etc/sweeper/robot.toml").read_text() == "# mine\n"


def test_the_boards_configuration_gets_its_lines_once_and_loses_only_them(tmp_path, root):
    path = root / "boot/firmware/config.txt"
    before = path.read_text()
    for _ in range(3):
        run(root, "install", source(tmp_path))
    text = path.read_text()
    assert text.startswith(before) and text.count("dtparam=i2c_arm=on") == 1
    assert "[all]\ndtparam=i2c_arm" in text  # not only under [pi4]
    run(root, "uninstall")
    assert path.read_text() == before


def test_an_update_is_on_trial_until_it_ran_a_minute(tmp_path, root, capsys):
    run(root, "install", source(tmp_path))
    old = status(root, capsys)["current"]
    assert run(root, "update", source(tmp_path, "0.2.0")) == 0
    now = status(root, capsys)
    assert now["current"].startswith("0.2.0") and now["previous"] == old
    assert now["trial_starts"] == 0
    run(root, "count")
    assert status(root, capsys)["trial_starts"] == 1
    run(root, "good")
    assert status(root, capsys)["trial_starts"] is None
    for _ in range(10):
        run(root, "count")
    assert status(root, capsys)["current"].startswith("0.2.0")


def test_three_starts_without_a_good_minute_roll_back(tmp_path, root, capsys):
    run(root, "install", source(tmp_path))
    old = status(root, capsys)["current"]
    run(root, "update", source(tmp_path, "0.2.0"))
    for _ in range(3):
        run(root, "count")
        assert status(root, capsys)["current"].startswith("0.2.0")
    run(root, "count")
    assert status(root, capsys) == {"current": old, "previous": old, "trial_starts": None}
    assert (
        "0.1.0"
        in subprocess.run(
            ["sh", root / "opt/sweeper/current/bin/sweeper"],
            capture_output=True,
            text=True,
            check=True,
        ).stdout
    )
    assert "rolled back" in (root / "opt/sweeper/history.log").read_text()
    for _ in range(5):  # the old one is no trial
        run(root, "count")
    assert status(root, capsys)["current"] == old


def test_two_bad_updates_in_a_row_still_know_the_good_one(tmp_path, root, capsys):
    run(root, "install", source(tmp_path))
    old = status(root, capsys)["current"]
    run(root, "update", source(tmp_path, "0.2.0"))
    run(root, "count")
    run(root, "update", source(tmp_path, "0.3.0"))
    assert status(root, capsys)["previous"] == old
    for _ in range(4):
        run(root, "count")
    assert status(root, capsys)["current"] == old


def test_an_update_that_cannot_be_built_changes_nothing(tmp_path, root, capsys):
    run(root, "install", source(tmp_path))
    before = files(root)

    def fail(origin, folder):
        build(origin, folder)
        raise manage.Refused("pip failed.")

    assert run(root, "update", source(tmp_path, "0.2.0"), build=fail) == 2
    assert "pip failed" in capsys.readouterr().err
    after = files(root)
    assert {k: v for k, v in after.items() if "0.2.0" not in k} == before
    assert run(root, "update", source(tmp_path, "0.2.0")) == 0  # and it can be tried again
    assert status(root, capsys)["current"].startswith("0.2.0")


def test_a_damaged_release_is_left_for_the_previous_one(tmp_path, root, capsys):
    run(root, "install", source(tmp_path))
    run(root, "update", source(tmp_path, "0.2.0"))
    run(root, "good")
    (root / "opt/sweeper/current/.complete").unlink()
    run(root, "count")
    assert status(root, capsys)["current"].startswith("0.1.0")


def test_only_two_slots_are_kept(tmp_path, root):
    run(root, "install", source(tmp_path))
    for minor in (2, 3, 4):
        run(root, "update", source(tmp_path, f"0.{minor}.0"))
        run(root, "good")
    names = sorted(p.name[:5] for p in (root / "opt/sweeper/releases").iterdir())
    assert names == ["0.3.0", "0.4.0"]


def test_a_broken_release_cannot_break_the_way_back(tmp_path, root):
    run(root, "install", source(tmp_path))
    tool = (root / "opt/sweeper/boot/manage.py").read_bytes()
    bad = source(tmp_path, "0.2.0")
    (bad / "deploy/manage.py").write_text("raise SystemExit(1)\n")
    run(root, "update", bad)
    assert (root / "opt/sweeper/boot/manage.py").read_bytes() == tool
    run(root, "good")
    assert (root / "opt/sweeper/boot/manage.py").read_bytes() != tool


def test_the_boot_tool_runs_alone_on_the_systems_python(tmp_path, root):
    run(root, "install", source(tmp_path))
    run(root, "update", source(tmp_path, "0.2.0"))
    for _ in range(4):
        subprocess.run(
            [sys.executable, "-I", "-S", root / "opt/sweeper/boot/manage.py", "count",
             "--root", root], check=True, capture_output=True,
        )  # fmt: skip
    assert os.readlink(root / "opt/sweeper/current").startswith("releases/0.1.0")


def test_uninstall_leaves_settings_and_maps_unless_purged(tmp_path, root):
    for purge in ((), ("--purge",)):
        run(root, "install", source(tmp_path))
        (root / "var/lib/private/sweeper").mkdir(parents=True, exist_ok=True)
        (root / "var/lib/private/sweeper/home.npz").write_bytes(b"map")
        assert run(root, "uninstall", *purge) == 0
        left = set(files(root))
        mine = {"etc/sweeper/robot.toml", "var/lib/private/sweeper/home.npz"}
        assert left == {"boot/firmware/config.txt"} | (set() if purge else mine)


@pytest.mark.parametrize(
    ("words", "said"),
    [(("update",), "path of a checkout"), (("install", "/nonexistent"), "no checkout"),
     (("update", "SOURCE"), "nothing is installed yet")],
)  # fmt: skip
def test_mistakes_are_explained(tmp_path, root, capsys, words, said):
    words = [str(source(tmp_path)) if w == "SOURCE" else w for w in words]
    assert run(root, *words) == 2
    assert said in capsys.readouterr().err


def test_the_shell_script_refuses_what_it_does_not_know():
    done = subprocess.run(
        ["sh", REPOSITORY / "deploy/install.sh", "--rot"], capture_output=True, text=True
    )
    assert done.returncode == 2 and "--rot" in done.stderr


def test_every_placed_file_exists_and_every_unit_is_placed():
    assert all((REPOSITORY / origin).is_file() for origin in manage.PLACED)
    on_disk = {p.name for p in (REPOSITORY / "systemd").iterdir()}
    assert on_disk == set(manage.UNITS)
    assert set(manage.ENABLED) <= set(manage.UNITS)
