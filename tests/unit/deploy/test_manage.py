"""Install, update and removal, in a folder that stands for the card."""

import subprocess

import pytest
import releases
from card import REPOSITORY, build, files, run, source, status


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


def test_an_update_that_cannot_be_built_changes_nothing(tmp_path, root, capsys):
    run(root, "install", source(tmp_path))
    before = files(root)

    def fail(origin, folder):
        build(origin, folder)
        raise releases.Refused("pip failed.")

    assert run(root, "update", source(tmp_path, "0.2.0"), build=fail) == 2
    assert "pip failed" in capsys.readouterr().err
    after = files(root)
    assert {k: v for k, v in after.items() if "0.2.0" not in k} == before
    assert run(root, "update", source(tmp_path, "0.2.0")) == 0  # and it can be tried again
    assert status(root, capsys)["current"].startswith("0.2.0")


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
