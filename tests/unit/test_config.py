"""The configuration refuses what it does not know, by name."""

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.config import Config, dump_config, load_config, parse_config
from robot.errors import ConfigError


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("[camera]\nfokal_px = 228.0", "fokal_px"),
        ("[camera]\nfocal_px = -3.0", "camera.focal_px"),
        ("[camera]\nfocal_px = 'long'", "camera.focal_px"),
        ("[perception]\nmatcher = 'magic'", "perception.matcher"),
        ("[wheels]\nx = 1", "wheels"),
        ("[robot\n", "TOML"),
    ],
)
def test_a_mistake_is_named_in_one_sentence(text, named):
    with pytest.raises(ConfigError) as error:
        parse_config(text, "my.toml")
    message = str(error.value)
    assert message.startswith("my.toml") and named in message and "\n" not in message


def test_the_effective_configuration_reads_back_equal():
    config = parse_config("[robot]\ncruise_mps = 0.2")
    assert parse_config(dump_config(config)) == config
    assert config.robot.cruise_mps == 0.2


def test_an_empty_file_is_the_defaults():
    assert parse_config("") == Config() == load_config(None)


def test_a_missing_file_is_explained(tmp_path):
    with pytest.raises(ConfigError, match=r"none\.toml.*--config"):
        load_config(tmp_path / "none.toml")


@given(st.text(max_size=60))
def test_any_text_is_a_configuration_or_a_config_error(text):
    try:
        assert isinstance(parse_config(text), Config)
    except ConfigError as error:
        assert str(error)


def test_every_default_is_within_its_own_range():
    tree = msgspec.to_builtins(Config())
    assert msgspec.convert(tree, Config) == Config()
