"""The configuration: every key, its default and its range, on one page.

A file holds only differences from these defaults. Unknown keys and values out of range are
refused with the key's name. The effective configuration is saved with every run.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import msgspec
from msgspec import Meta, Struct

from robot.errors import ConfigError
from robot.geometry.stereo import StereoCamera, base_from_cam

Positive = Annotated[float, Meta(gt=0.0)]
NotNegative = Annotated[float, Meta(ge=0.0)]
Fraction = Annotated[float, Meta(ge=0.0, le=1.0)]
Count = Annotated[int, Meta(ge=1)]


class Section(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A table of the TOML file: immutable, and strict about its keys."""


class RobotConfig(Section):
    """Shape and limits of the machine."""

    radius_m: Positive = 0.17
    brush_width_m: Positive = 0.20
    track_width_m: Positive = 0.23
    cruise_mps: Annotated[float, Meta(gt=0.0, le=0.5)] = 0.25
    max_yaw_rate_radps: Annotated[float, Meta(gt=0.0, le=3.0)] = 1.2
    dock_marker_id: Annotated[int, Meta(ge=0, le=49)] = 7  # ArUco dictionary 4x4_50
    dock_marker_size_m: Positive = 0.09


class CameraConfig(Section):
    """The rectified pair that perception works on."""

    width_px: Count = 320
    height_px: Count = 240
    focal_px: Positive = 228.0
    baseline_m: Positive = 0.06
    rate_hz: Annotated[float, Meta(gt=0.0, le=60.0)] = 10.0
    x_m: float = 0.13  # the left eye in `base`
    y_m: float = 0.03
    z_m: Positive = 0.09
    pitch_rad: float = 0.0
    device: str = "0"  # side-by-side camera: number or path
    calibration: str = ""  # ROS camera_info, OpenCV or Kalibr file; empty: already rectified

    def stereo_camera(self) -> StereoCamera:
        """The ideal camera that these keys describe."""
        return StereoCamera(
            self.width_px,
            self.height_px,
            self.focal_px,
            (self.width_px - 1) / 2.0,
            (self.height_px - 1) / 2.0,
            self.baseline_m,
            base_from_cam(self.x_m, self.y_m, self.z_m, self.pitch_rad),
        )


class PerceptionConfig(Section):
    """From a pair of images to landmarks and scan."""

    matcher: Literal["onnx", "sgbm", "given"] = "sgbm"
    model: str = ""  # ONNX file; empty: the manifest's default
    max_disparity_px: Count = 64


class SlamConfig(Section):
    """The EKF and its association."""

    wheel_noise_m_per_sqrt_m: Positive = 0.01  # random walk of each wheel's travel
    wheel_scale_sigma: NotNegative = 0.02  # how wrong a wheel's diameter may be, relative
    gyro_noise_rad_per_sqrt_s: Positive = 0.003
    gyro_bias_sigma_radps: NotNegative = 0.02  # before the first standstill
    gyro_bias_walk: NotNegative = 0.0002  # rad/s per sqrt(s)
    degraded_sigma_m: Positive = 0.3  # one sigma of the position along its worse direction
    lost_sigma_m: Positive = 1.0


class MappingConfig(Section):
    """The occupancy grid."""

    resolution_m: Annotated[float, Meta(gt=0.0, le=0.2)] = 0.05


class PlanningConfig(Section):
    """Coverage and routes."""


class ControlConfig(Section):
    """Following and the safety gate."""


class MissionConfig(Section):
    """What a cleaning run does."""


class LinkConfig(Section):
    """The serial bridge to the motor controller."""

    port: str = ""  # empty: find it by its USB name
    baud: Count = 115200
    metres_per_tick: Annotated[float, Meta(gt=0.0, le=0.01)] = 0.0002  # 5000 ticks a metre
    max_wheel_mps: Annotated[float, Meta(gt=0.0, le=0.5)] = 0.5  # rim speed, each wheel
    battery_empty_v: Positive = 12.0  # 0 % of a pack of four lithium-ion cells
    battery_full_v: Positive = 16.4  # 100 %


class LogConfig(Section):
    """What is kept of a run."""

    chunk_bytes: Count = 262144


class SimConfig(Section):
    """The built-in simulator's imperfections."""


class Config(Section):
    """The whole file."""

    robot: RobotConfig = RobotConfig()
    camera: CameraConfig = CameraConfig()
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
        raise ConfigError(
            f"{name}: {what} (at {key}); correct or remove that key, defaults are in robot/config.py."
        ) from None
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
