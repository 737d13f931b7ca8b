"""The command line: exit codes, sentences and manuals, from outside."""

import subprocess
import sys

import pytest

VERBS = ["run", "record", "replay", "bench", "check", "ask", "wheels"]


def sweeper(*arguments, cwd=None):
    return subprocess.run(
        [sys.executable, "-m", "robot", *arguments],
        capture_output=True,
        text=True,
        cwd=cwd,
        check=False,
    )


def test_help_lists_every_verb():
    result = sweeper("--help")
    assert result.returncode == 0
    assert all(verb in result.stdout for verb in VERBS)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["run", "--config", "none.toml"], "none.toml"),
        (["run", "--scene", "no-such-scene"], "no-such-scene"),
        (["run", "--duration-s", "-1"], "--duration-s"),
        (["run", "--body", "live"], "link.port"),
        (["replay", "none.mcap"], "none.mcap"),
        (["bench", "pipeline", "--frames", "nowhere"], "nowhere"),
        (["bench", "stereo", "--pairs", "nowhere"], "nowhere"),
        (["ask", "start", "--socket", "none.sock"], "none.sock"),
        (["wheels", "stop"], "link.port"),
    ],
    ids=lambda value: "-".join(value) if isinstance(value, list) else "",
)
def test_a_mistake_is_one_sentence_and_exit_code_2(arguments, named, tmp_path):
    result = sweeper(*arguments, cwd=tmp_path)
    lines = result.stderr.strip().splitlines()
    assert result.returncode == 2, result.stderr
    assert len(lines) == 1 and named in lines[0], result.stderr


def test_an_unknown_key_in_the_configuration_is_named(tmp_path):
    (tmp_path / "my.toml").write_text("[camera]\nfokal_px = 1.0\n")
    result = sweeper("run", "--config", "my.toml", cwd=tmp_path)
    assert result.returncode == 2
    assert "my.toml" in result.stderr and "fokal_px" in result.stderr


def test_a_model_of_the_wrong_shape_is_refused(tmp_path):
    (tmp_path / "bad.onnx").write_bytes(b"not a network")
    (tmp_path / "my.toml").write_text('[perception]\nmatcher = "onnx"\nmodel = "bad.onnx"\n')
    result = sweeper("run", "--config", "my.toml", cwd=tmp_path)
    assert result.returncode == 2
    assert "perception.model" in result.stderr or "bad.onnx" in result.stderr


def test_a_missing_calibration_is_refused(tmp_path):
    (tmp_path / "my.toml").write_text('[camera]\ncalibration = "none.yaml"\n')
    result = sweeper("run", "--config", "my.toml", cwd=tmp_path)
    assert result.returncode == 2 and "none.yaml" in result.stderr
