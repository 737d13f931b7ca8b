"""Opens what the configuration names: calibration, network, motor controller.

Files are read here and handed inward as bytes or text; the rooms themselves stay pure.
"""

from __future__ import annotations

import hashlib
import time
import tomllib
from importlib import resources
from pathlib import Path

from robot.config import CameraConfig, Config
from robot.errors import CalibrationError, ConfigError, HardwareError, ModelError
from robot.geometry.stereo import StereoCamera
from robot.hardware.battery_i2c import BatteryGauge, Pack
from robot.hardware.frames_folder import FramesFolder
from robot.hardware.i2c import open_bus
from robot.hardware.imu_i2c import Imu
from robot.hardware.libcamera_stereo import LibcameraStereo
from robot.hardware.stereo import StereoSource, WatchedStereo
from robot.hardware.uvc import UvcStereo
from robot.perception.calibration_files import parse_calibration
from robot.perception.chain import Perception
from robot.perception.depth import Depth, make_depth
from robot.perception.floor import rows_above_near_floor
from robot.perception.rectify import Rectifier


def read_calibration(config: Config) -> str:
    """Text of the file `camera.calibration`. Raises CalibrationError when it cannot be read."""
    name = config.camera.calibration
    try:
        return Path(name).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise CalibrationError(
            f"camera.calibration = '{name}' cannot be read ({error}); calibrate the cameras, or "
            "name an existing ROS camera_info, OpenCV or EuRoC file."
        ) from None


def open_calibration(config: Config) -> Rectifier | None:
    """The rectifier for `camera.calibration`; None when frames arrive rectified.

    Raises CalibrationError when the file is missing or unfit.
    """
    camera = config.camera
    if not camera.calibration:
        return None
    return Rectifier(
        parse_calibration(read_calibration(config), camera.calibration),
        camera.width_px,
        camera.height_px,
        camera.stereo_camera().base_from_cam,
    )


def open_depth(config: Config, camera: StereoCamera, rows: int | None = None) -> Depth:
    """The configured matcher, with its network read and its hash checked. Raises ModelError.

    Disparity is needed in the first `rows` only; None: everywhere.
    """
    if config.perception.matcher != "onnx":
        return make_depth(config.perception, camera, None, rows=rows)
    name = config.perception.model
    try:
        return make_depth(config.perception, camera, read_model(name))
    except ModelError as error:
        raise ModelError(f"perception.model = '{name or 'default'}': {error}") from None


def open_perception(config: Config) -> Perception:
    """The whole chain from frame to `Seen` for the robot on its floor, timed by the real clock."""
    rectifier = open_calibration(config)
    camera = rectifier.camera if rectifier else config.camera.stereo_camera()
    return Perception(
        config.perception,
        config.robot,
        camera,
        open_depth(config, camera, rows_above_near_floor(camera, config.perception)),
        rectifier,
        clock=time.perf_counter_ns,
    )


def open_stereo(config: Config, raw_size_px: tuple[int, int] | None = None) -> WatchedStereo:
    """The configured cameras, started again whenever they fail.

    They deliver eyes of `raw_size_px`; None: the size of the calibration, or else the working
    size. Raises HardwareError when there is none, FrameError for an unfit folder.
    """
    camera = config.camera
    if raw_size_px is None:
        rectifier = open_calibration(config)
        raw_size_px = rectifier.raw_size_px if rectifier else (camera.width_px, camera.height_px)
    width_px, height_px = raw_size_px

    def open_source() -> StereoSource:
        if camera.source == "folder":
            return FramesFolder(Path(camera.device), rate_hz=camera.rate_hz)
        if camera.source == "uvc":
            return UvcStereo(
                camera.device,
                eye_width_px=width_px,
                eye_height_px=height_px,
                rate_hz=camera.rate_hz,
                exposure_us=camera.exposure_us,
                gain=camera.gain,
                timeout_s=camera.timeout_s,
            )
        return LibcameraStereo(
            camera_names(camera),
            eye_width_px=width_px,
            eye_height_px=height_px,
            rate_hz=camera.rate_hz,
            exposure_us=camera.exposure_us,
            gain=camera.gain,
            timeout_s=camera.timeout_s,
        )

    return WatchedStereo(open_source)


def camera_names(camera: CameraConfig) -> list[str]:
    """The libcamera cameras that `camera.device` names. Raises ConfigError for a wrong number."""
    names = [name.strip() for name in camera.device.split(",") if name.strip()]
    wanted = 2 if camera.source == "libcamera-dual" else 1
    if len(names) != wanted:
        raise ConfigError(
            f"camera.device = '{camera.device}' names {len(names)} cameras where camera.source = "
            f"'{camera.source}' needs {wanted}; write "
            + ("'0,1', the left one first." if wanted == 2 else "one number or id.")
        )
    return names


def open_imu(config: Config) -> Imu:
    """The IMU. Raises HardwareError when it is missing or fails its set-up."""
    sensors = config.sensors
    bus = open_bus(config.robot.i2c_bus)
    return Imu(bus, axis=sensors.imu_axis, bias_radps=sensors.imu_bias_radps)


def open_gyro(config: Config) -> Imu | None:
    """The gyro, or None when it is missing: the robot then drives degraded."""
    try:
        return open_imu(config)
    except HardwareError:
        return None


def open_battery_gauge(config: Config) -> BatteryGauge:
    """The battery gauge. Raises HardwareError when it does not answer."""
    sensors = config.sensors
    return BatteryGauge(
        open_bus(config.robot.i2c_bus),
        pack=Pack(sensors.cells, sensors.capacity_ah, sensors.internal_ohm),
        shunt_ohm=sensors.shunt_ohm,
        address=sensors.gauge_address,
    )


def open_gauge(config: Config) -> BatteryGauge | None:
    """The battery gauge, or None when there is none: the motor controller's voltage serves."""
    if config.sensors.gauge == "none":
        return None
    try:
        return open_battery_gauge(config)
    except HardwareError:
        return None


def read_model(name: str) -> bytes:
    """Bytes of a network: a file's path, a name in the manifest, or empty for its default.

    Raises ModelError when it is missing, or differs from the manifest's hash.
    """
    if name.endswith(".onnx"):
        try:
            return Path(name).read_bytes()
        except OSError as error:
            raise ModelError(
                f"the file cannot be read ({error.strerror}); name an existing ONNX file, or leave "
                "the key out."
            ) from None
    folder = resources.files("models")
    manifest = tomllib.loads((folder / "manifest.toml").read_text(encoding="utf-8"))
    name = name or manifest["default"]
    entries = {entry["name"]: entry for entry in manifest["networks"]}
    if name not in entries:
        raise ModelError(
            f"'{name}' is not in models/manifest.toml; choose one of {', '.join(entries)}, or give "
            "the path of an .onnx file."
        )
    entry = entries[name]
    artifact = folder / entry["file"]
    data = artifact.read_bytes() if artifact.is_file() else b""
    if hashlib.sha256(data).hexdigest() != entry["sha256"]:
        raise ModelError(
            f"models/{entry['file']} is missing or differs from its hash in models/manifest.toml; "
            "restore it with git, or export it again."
        )
    return data
