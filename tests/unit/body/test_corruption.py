"""A hundred random damages to settings, calibration and network: each is refused by its name.

A damage that leaves the same meaning (in a comment, in white space, in a digit that keeps the file
valid) is none, and does not count.
"""

import hashlib
import shutil
from pathlib import Path

import numpy as np
import pytest

from robot.body import sources
from robot.calibrate.files import Provenance, write_calibration
from robot.config import dump_config, load_config, parse_config
from robot.errors import CalibrationError, ConfigError, ModelError
from robot.perception.calibration import Eye, StereoCalibration
from robot.perception.calibration_files import parse_calibration

DAMAGES = 100


def damage(data, rng):
    """Cut, flip, overwrite, drop or repeat a part."""
    kind, length = rng.integers(5), len(data)
    start = int(rng.integers(length))
    end = min(length, start + int(rng.integers(1, max(2, length // 8))))
    if kind == 0:
        return data[:start]
    if kind == 1:
        return data[:start] + bytes([data[start] ^ 1 << int(rng.integers(8))]) + data[start + 1 :]
    if kind == 2:
        return data[:start] + rng.bytes(end - start) + data[end:]
    if kind == 3:
        return data[:start] + data[end:]
    return data[:end] + data[start:end] + data[end:]


def refusals(path, data, read, error, same):
    """How many damages were refused, each in a sentence with the file's name."""
    rng = np.random.default_rng(7)
    refused = tried = 0
    while refused < DAMAGES:
        tried += 1
        assert tried < 40 * DAMAGES, "damages go unnoticed"
        path.write_bytes(damage(data, rng))
        try:
            value = read(path)
        except error as problem:
            assert path.name in str(problem) or path.stem in str(problem), problem
            assert "\n" not in str(problem)
            refused += 1
        else:
            same(value)
    return refused


def test_damaged_settings(tmp_path):
    path = tmp_path / "robot.toml"
    data = dump_config(parse_config("")).encode()
    # Whatever is accepted is a valid configuration: its own text is read back.
    count = refusals(path, data, load_config, ConfigError, lambda c: parse_config(dump_config(c)))
    assert count == DAMAGES


def test_damaged_calibrations(tmp_path):
    pose = np.eye(4)
    pose[0, 3] = -0.06
    matrix = np.array([[456.0, 0, 319.5], [0, 456.0, 239.5], [0, 0, 1]])
    eye = Eye(640, 480, matrix, np.array([-0.1, 0.02, 0.0, 0.0, 0.0]))
    provenance = Provenance("2030-01-01T00:00:00+00:00", 0.2, 0.1)
    text = write_calibration(StereoCalibration(eye, eye, pose), "opencv", provenance)[0]
    path = tmp_path / "stereo.yaml"

    def read(file):
        config = parse_config(f'[camera]\ncalibration = "{file}"\n')
        return parse_calibration(sources.read_calibration(config), str(file))

    def plausible(calibration):
        assert 0.005 <= calibration.baseline_m <= 2.0
        assert np.all(np.isfinite(calibration.left.matrix))

    assert refusals(path, text.encode(), read, CalibrationError, plausible) == DAMAGES


def test_damaged_networks(tmp_path, monkeypatch):
    models = Path(sources.__file__).parents[2] / "models"
    copy = tmp_path / "models"
    (copy / "artifacts").mkdir(parents=True)
    shutil.copy(models / "manifest.toml", copy)
    monkeypatch.setattr(sources.resources, "files", lambda name: copy)
    data = (models / "artifacts/hybrid.onnx").read_bytes()
    path = copy / "artifacts/hybrid.onnx"

    def whole(read):
        assert hashlib.sha256(read).digest() == hashlib.sha256(data).digest()

    count = refusals(path, data, lambda file: sources.read_model("hybrid"), ModelError, whole)
    assert count == DAMAGES


@pytest.mark.parametrize("content", [b"", b"\0" * 4096, b"\xff\xfe" * 100])
def test_what_a_dying_card_leaves(tmp_path, content):
    path = tmp_path / "stereo.yaml"
    path.write_bytes(content)
    config = parse_config(f'[camera]\ncalibration = "{path}"\n')
    with pytest.raises(CalibrationError, match=r"stereo\.yaml"):
        parse_calibration(sources.read_calibration(config), str(path))
    toml = tmp_path / "robot.toml"
    toml.write_bytes(content)
    if content:
        with pytest.raises(ConfigError, match=r"robot\.toml"):
            load_config(toml)
