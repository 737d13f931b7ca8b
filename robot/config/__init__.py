"""The configuration: every key, its default and its range, a page for each part of the robot.

A file holds only differences from these defaults. Unknown keys and values out of range are
refused with the key's name. The effective configuration is saved with every run.
"""

from __future__ import annotations

from pathlib import Path

import msgspec

from robot.config.doing import ControlConfig, MissionConfig, PlanningConfig
from robot.config.machine import CameraConfig, LinkConfig, LogConfig, RobotConfig, SensorsConfig
from robot.config.section import Section
from robot.config.seeing import MappingConfig, PerceptionConfig, SlamConfig
from robot.config.world import SimConfig
from robot.errors import ConfigError

__all__ = [
    "CameraConfig",
    "Config",
    "ControlConfig",
    "LinkConfig",
    "LogConfig",
    "MappingConfig",
    "MissionConfig",
    "PerceptionConfig",
    "PlanningConfig",
    "RobotConfig",
    "Section",
    "SensorsConfig",
    "SimConfig",
    "SlamConfig",
    "dump_config",
    "load_config",
    "parse_config",
]


class Config(Section, frozen=True):
    """The whole file."""

    robot: RobotConfig = RobotConfig()
    camera: CameraConfig = CameraConfig()
    sensors: SensorsConfig = SensorsConfig()
    perception: PerceptionConfig = PerceptionConfig()
    slam: SlamConfig = SlamConfig()
    mapping: MappingConfig = MappingConfig()
    planning: PlanningConfig = PlanningConfig()
    control: ControlConfig = ControlConfig()
    mission: MissionConfig = MissionConfig()
    link: LinkConfig = LinkConfig()
    log: LogConfig = LogConfig()
    sim: SimConfig = SimConfig()


def parse_config(text: str, name: str = "config.toml") -> Config:
    """Read a configuration from TOML text.

    Raises ConfigError, naming `name` and the key, for malformed TOML, an unknown key, a wrong
    type or a value out of range.
    """
    try:
        return msgspec.toml.decode(text, type=Config)
    except msgspec.ValidationError as error:
        what, _, where = str(error).partition(" - at ")
        key = where.strip("`").removeprefix("$.") or "the top level"
        raise ConfigError(f"{name}: {what} (at {key}); correct or remove that key.") from None
    except msgspec.DecodeError as error:
        raise ConfigError(f"{name}: not valid TOML: {error}; correct that line.") from None


def load_config(path: Path | None) -> Config:
    """Read `path`, or the defaults when it is None. Raises ConfigError."""
    if path is None:
        return Config()
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(
            f"{path}: cannot be read as text ({error}); give an existing TOML file to --config."
        ) from None
    return parse_config(text, str(path))


def dump_config(config: Config) -> str:
    """The effective configuration as TOML; `parse_config` of it gives an equal `Config`."""
    return msgspec.toml.encode(config).decode("utf-8")
