"""The trial of a release, and the way back."""

import os
import subprocess
import sys

from card import files, run, source, status


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
    tool = (root / "opt/sweeper/boot/slots.py").read_bytes()
    bad = source(tmp_path, "0.2.0")
    (bad / "deploy/slots.py").write_text("raise SystemExit(1)\n")
    run(root, "update", bad)
    assert (root / "opt/sweeper/boot/slots.py").read_bytes() == tool
    run(root, "good")
    assert (root / "opt/sweeper/boot/slots.py").read_bytes() != tool


def test_the_boot_tool_runs_alone_on_the_systems_python(tmp_path, root):
    run(root, "install", source(tmp_path))
    run(root, "update", source(tmp_path, "0.2.0"))
    for _ in range(4):
        subprocess.run(
            [sys.executable, "-I", "-S", root / "opt/sweeper/boot/slots.py", "count",
             "--root", root], check=True, capture_output=True,
        )  # fmt: skip
    assert os.readlink(root / "opt/sweeper/current").startswith("releases/0.1.0")


def test_units_go_back_with_their_release(tmp_path, root):
    """A rolled back release must not be started with the options of the one that failed."""
    unit = root / "etc/systemd/system/sweeper.service"
    run(root, "install", source(tmp_path))
    mine = unit.read_text()
    new = source(tmp_path, "0.2.0")
    (new / "systemd/sweeper.service").write_text("[Service]\nExecStart=/x --new-option\n")
    run(root, "update", new)
    assert "--new-option" in unit.read_text()
    for _ in range(4):
        run(root, "count")
    assert unit.read_text() == mine


def test_each_start_mends_what_a_cut_left_of_the_units(tmp_path, root):
    run(root, "install", source(tmp_path))
    whole = files(root)
    (root / "etc/systemd/system/sweeper-good.service").unlink()
    (root / "etc/udev/rules.d/99-sweeper.rules").write_text("another release's\n")
    run(root, "count")
    assert files(root) == whole
