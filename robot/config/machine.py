"""The machine: its shape, its eyes, its other sensors, its motor controller, its log."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from robot.config.section import Count, NotNegative, Positive, Section
from robot.geometry.stereo import StereoCamera, base_from_cam


class RobotConfig(Section, frozen=True):
    """Shape and limits of the machine."""

    radius_m: Positive = 0.17
    brush_width_m: Positive = 0.20
    track_width_m: Positive = 0.23
    # of the sensors that look down, under the front rim, from the left
    cliff_bearings_rad: tuple[float, float, float, float] = (0.8, 0.3, -0.3, -0.8)
    cruise_mps: Annotated[float, Meta(gt=0.0, le=0.5)] = 0.25
    max_yaw_rate_radps: Annotated[float, Meta(gt=0.0, le=3.0)] = 1.6
    i2c_bus: Annotated[int, Meta(ge=0, le=30)] = 1  # of the gyro
    dock_marker_id: Annotated[int, Meta(ge=0, le=49)] = 7  # ArUco dictionary 4x4_50
    dock_marker_size_m: Positive = 0.09
    dock_width_m: Positive = 0.20
    button: str = ""  # an input device that starts, pauses and (held) sends home
    buzzer: str = ""  # a file that sounds it with 1, such as /sys/class/leds/buzzer/brightness


class CameraConfig(Section, frozen=True):
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
    source: Literal["uvc", "libcamera", "libcamera-dual", "folder"] = "uvc"
    device: str = "0"  # number, path or id; "left,right" for libcamera-dual
    exposure_us: Annotated[int, Meta(ge=0, le=100_000)] = 0  # of both eyes; 0: automatic
    gain: Annotated[float, Meta(ge=1.0, le=64.0)] = 1.0  # of both eyes, with a fixed exposure
    timeout_s: Annotated[float, Meta(ge=0.1, le=10.0)] = 1.0  # without a frame: start it again
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


class SensorsConfig(Section, frozen=True):
    """What else is on the I2C bus (`robot.i2c_bus`)."""

    imu_axis: Literal["x", "y", "z", "-x", "-y", "-z"] = "z"  # the chip's axis that points up
    imu_bias_radps: Annotated[float, Meta(ge=-0.5, le=0.5)] = 0.0  # of `sweeper calibrate imu`
    gauge: Literal["none", "auto"] = "none"  # a battery gauge INA219 or INA226
    gauge_address: Annotated[int, Meta(ge=0x40, le=0x4F)] = 0x40
    shunt_ohm: Annotated[float, Meta(gt=0.0, le=1.0)] = 0.01
    cells: Annotated[int, Meta(ge=1, le=8)] = 4  # lithium-ion cells in series
    capacity_ah: Annotated[float, Meta(gt=0.0, le=50.0)] = 2.6
    internal_ohm: Annotated[float, Meta(ge=0.0, le=2.0)] = 0.12  # of the whole pack


class LinkConfig(Section, frozen=True):
    """The serial bridge to the motor controller."""

    port: str = ""  # empty: find it by its USB name
    baud: Count = 115200
    metres_per_tick: Annotated[float, Meta(gt=0.0, le=0.01)] = 0.0002  # 5000 ticks a metre
    max_wheel_mps: Annotated[float, Meta(gt=0.0, le=0.5)] = 0.5  # rim speed, each wheel
    full_speed_mps: Annotated[float, Meta(ge=0.1, le=2.0)] = 0.6  # of a free wheel at full power
    battery_empty_v: Positive = 12.0  # 0 % of a pack of four lithium-ion cells
    battery_full_v: Positive = 16.4  # 100 %


class LogConfig(Section, frozen=True):
    """What is kept of a run."""

    chunk_bytes: Count = 262144  # what a crash can lose at most, before compression
    # Channels for people only, per second; 0: never. Events and commands are always complete.
    pose_hz: NotNegative = 10.0
    scan_hz: NotNegative = 5.0
    map_hz: NotNegative = 0.5
    landmarks_hz: NotNegative = 0.2
