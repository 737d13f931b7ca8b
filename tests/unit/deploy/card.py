"""What the tests of installation share: a small checkout, a quick build, a look at the card."""

import json
import os
import shutil
from pathlib import Path

import manage
import slots

REPOSITORY = Path(__file__).resolve().parents[3]


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


def run(root, *words, build=build):
    """`manage.py` or `slots.py`, whichever knows the verb, on the card."""
    words = [*map(str, words), "--root", str(root)]
    if words[0] in ("install", "update", "uninstall"):
        return manage.main(words, build)
    return slots.main(words)


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
