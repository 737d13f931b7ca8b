"""Counting instructions: what is printed is read right, and entries survive each other."""

import hashlib

import numpy as np
import pytest

pytest.importorskip("tomli_w")
from models import manifest
from models.a53 import __main__ as command
from models.a53.emulator import guest_python, parse
from models.a53.guest import classical, eyes


def test_counts_are_differences_between_markers():
    printed = "noise\nCOUNT 0 1000000\nCOUNT 1 3500000\nCOUNT 2 4000000\nwarning\nCOUNT 3 4000002\n"
    assert parse(printed, 2) == [2.5, 0.000002]
    with pytest.raises(SystemExit, match="Illegal instruction"):
        parse("COUNT 0 12\nIllegal instruction", 1)


def test_the_newest_python_of_the_guest_is_found(tmp_path):
    (tmp_path / "usr/bin").mkdir(parents=True)
    for name in ("python3", "python3.11", "python3.11-config"):
        (tmp_path / "usr/bin" / name).touch()
    assert guest_python(tmp_path) == "3.11"
    with pytest.raises(SystemExit, match="no python3"):
        guest_python(tmp_path / "usr")


@pytest.mark.parametrize("name", command.CLASSICAL)
def test_the_classical_matchers_find_the_shift_of_the_pair(name):
    left, right = eyes()
    fixed = classical(name, left, right)()
    assert np.median(fixed[fixed > 0]) / 16 == pytest.approx(12, abs=0.1)


def test_measured_counts_are_entered_and_another_file_is_refused(tmp_path):
    path = tmp_path / "manifest.toml"
    (tmp_path / "x.onnx").write_bytes(b"weights")
    digest = hashlib.sha256(b"weights").hexdigest()
    manifest.enter(path, {"name": "x", "file": "x.onnx", "sha256": digest})
    assert command.networks(tmp_path) == {"x": tmp_path / "x.onnx"}
    command.enter(tmp_path, {"x": 12.345, "sgbm": 99.96})
    manifest.enter(path, {"name": "y", "file": "y.onnx", "sha256": ""})
    read = manifest.read(path)
    assert read["networks"][0]["a53_minstr"] == 12.3
    assert read["a53_minstr"] == {"sgbm": 100.0}
    (tmp_path / "x.onnx").write_bytes(b"other")
    with pytest.raises(SystemExit, match="sha256"):
        command.networks(tmp_path)
