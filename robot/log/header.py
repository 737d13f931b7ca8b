"""What a log says about itself: enough to build the same brain again."""

from __future__ import annotations

import base64
from dataclasses import dataclass, field

from robot import __version__
from robot.config import Config, parse_config
from robot.errors import LogError
from robot.geometry.stereo import StereoCamera
from robot.log.codec import decode, encode

METADATA_NAME = "sweeper"
FORMAT = "1"  # of topics and encodings; a reader refuses another one


@dataclass(frozen=True, slots=True)
class LogHeader:
    """Written once, before the first message.

    `config_toml` is the effective configuration, `camera` the rectified pair that perception
    works on, `calibration` the text of the raw pair's calibration file (empty: frames are already
    rectified) and `calibration_name` its file name. `wall_time` (ISO 8601) is the only wall clock
    time in a log. `home` is the file of the map that the run began with (empty: none). `extra` is
    for people, and for the hash of the network.
    """

    config_toml: str
    camera: StereoCamera | None = None
    calibration: str = ""
    calibration_name: str = ""
    scene: str = ""
    seed: int | None = None
    body: str = ""
    wall_time: str = ""
    software: str = __version__
    home: bytes = b""
    extra: dict[str, str] = field(default_factory=dict)

    def config(self) -> Config:
        """The configuration. Raises ConfigError if this version does not know it."""
        return parse_config(self.config_toml, "the configuration in the log's header")

    def to_metadata(self) -> dict[str, str]:
        """As an MCAP metadata record, text to text."""
        return {
            "format": FORMAT,
            "config": self.config_toml,
            "camera": encode(self.camera).decode() if self.camera else "",
            "calibration": self.calibration,
            "calibration_name": self.calibration_name,
            "scene": self.scene,
            "seed": "" if self.seed is None else str(self.seed),
            "body": self.body,
            "wall_time": self.wall_time,
            "software": self.software,
            "home": base64.b64encode(self.home).decode(),
            **{f"extra.{key}": value for key, value in self.extra.items()},
        }

    @staticmethod
    def from_metadata(data: dict[str, str], name: str) -> LogHeader:
        """Back from the record. Raises LogError, naming the file, for another format."""
        if data.get("format") != FORMAT:
            raise LogError(
                f"{name}: the log has format {data.get('format', 'unknown')!r}, this version reads "
                f"{FORMAT!r}; use Sweeper {data.get('software', 'unknown')}, which wrote it."
            )
        try:
            camera = data["camera"]
            seed = data["seed"]
            return LogHeader(
                config_toml=data["config"],
                camera=decode(StereoCamera, camera.encode()) if camera else None,
                calibration=data["calibration"],
                calibration_name=data["calibration_name"],
                scene=data["scene"],
                seed=int(seed) if seed else None,
                body=data["body"],
                wall_time=data["wall_time"],
                software=data["software"],
                home=base64.b64decode(data.get("home", ""), validate=True),
                extra={k[6:]: v for k, v in data.items() if k.startswith("extra.")},
            )
        except (KeyError, ValueError) as error:
            raise LogError(
                f"{name}: the log's header is incomplete ({error}); use a log written by `sweeper`."
            ) from None
