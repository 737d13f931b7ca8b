"""What a release carries."""

import subprocess
import sys

import manage
import releases
from card import REPOSITORY, build, run, source


def test_every_placed_file_exists_and_every_unit_is_placed():
    assert all((REPOSITORY / origin).is_file() for origin in releases.PLACED)
    on_disk = {p.name for p in (REPOSITORY / "systemd").iterdir()}
    assert on_disk == set(releases.UNITS)
    assert set(manage.ENABLED) <= set(releases.UNITS)


def test_a_release_can_remove_itself_without_its_checkout(tmp_path, root):
    run(root, "install", source(tmp_path))
    tool = root / "opt/sweeper/current/deploy/manage.py"
    subprocess.run([sys.executable, "-S", tool, "uninstall", "--root", root], check=True)
    assert not (root / "opt/sweeper").exists()
    assert not (root / "etc/systemd/system/sweeper.service").exists()


def test_the_name_says_the_version_and_changes_with_every_file(tmp_path):
    origin = source(tmp_path, "1.2.3")
    name = releases.release_name(origin)
    assert name.startswith("1.2.3-") and name == releases.release_name(origin)
    (origin / "systemd/sweeper.service").write_text("[Unit]\n")
    assert releases.release_name(origin) != name


def test_a_build_that_was_cut_off_is_begun_anew(tmp_path, root):
    origin = source(tmp_path)
    folder = root / "opt/sweeper/releases" / releases.release_name(origin)
    folder.mkdir(parents=True)
    (folder / "half").touch()
    releases.add_release(folder.parent, origin, build)
    assert (folder / ".complete").is_file() and not (folder / "half").exists()
