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
    max_yaw_rate_radps: Annotated[float, Meta(gt=0.0, le=3.0)] = 1.6
    i2c_bus: Annotated[int, Meta(ge=0, le=30)] = 1  # of the gyro
    dock_marker_id: Annotated[int, Meta(ge=0, le=49)] = 7  # ArUco dictionary 4x4_50
    dock_marker_size_m: Positive = 0.09
    dock_width_m: Positive = 0.20
    button: str = ""  # an input device that starts, pauses and (held) sends home
    buzzer: str = ""  # a file that sounds it with 1, such as /sys/class/leds/buzzer/brightness


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


class SensorsConfig(Section):
    """What else is on the I2C bus (`robot.i2c_bus`)."""

    imu_axis: Literal["x", "y", "z", "-x", "-y", "-z"] = "z"  # the chip's axis that points up
    imu_bias_radps: Annotated[float, Meta(ge=-0.5, le=0.5)] = 0.0  # of `sweeper calibrate imu`
    gauge: Literal["none", "auto"] = "none"  # a battery gauge INA219 or INA226
    gauge_address: Annotated[int, Meta(ge=0x40, le=0x4F)] = 0x40
    shunt_ohm: Annotated[float, Meta(gt=0.0, le=1.0)] = 0.01
    cells: Annotated[int, Meta(ge=1, le=8)] = 4  # lithium-ion cells in series
    capacity_ah: Annotated[float, Meta(gt=0.0, le=50.0)] = 2.6
    internal_ohm: Annotated[float, Meta(ge=0.0, le=2.0)] = 0.12  # of the whole pack


class PerceptionConfig(Section):
    """From a pair of images to landmarks and scan."""

    matcher: Literal["onnx", "sgbm", "given"] = "sgbm"
    model: str = ""  # ONNX file; empty: the manifest's default
    onnx_threads: Annotated[int, Meta(ge=1, le=16)] = 1
    max_disparity_px: Annotated[int, Meta(ge=16, le=256, multiple_of=16)] = 64
    min_confidence: Fraction = 0.8  # of the network; at 0.5 some near things look like free floor
    image_noise: NotNegative = 2.0  # grey levels of one sigma; flat walls are told by it
    # scan
    min_obstacle_m: Positive = 0.02  # lower things are driven over
    max_obstacle_m: Positive = 0.12  # higher things are driven under
    scan_range_m: Annotated[float, Meta(gt=0.2, le=10.0)] = 3.0
    scan_bearings: Annotated[int, Meta(ge=8, le=720)] = 120
    # landmarks
    max_tracks: Annotated[int, Meta(ge=8, le=500)] = 120
    max_landmarks: Count = 40  # handed on per frame
    landmark_age: Count = 5  # frames that a point must have been followed
    landmark_range_m: Positive = 5.0
    edges: bool = True  # vertical edges beside points
    edge_every: Count = 2  # frames from one search for them to the next
    max_step_m: Positive = 0.3  # of visual odometry between two frames: more is a mistake
    # dock marker
    marker_every: Count = 3  # frames between two searches while no marker is in sight


class SlamConfig(Section):
    """The EKF and its association."""

    # odometry
    wheel_noise_m_per_sqrt_m: Positive = 0.004  # random walk of a wheel's travel on firm floor
    slip_noise_m_per_sqrt_m: NotNegative = 0.025  # and by slips that nothing notices
    wheel_scale_sigma: NotNegative = 0.02  # how wrong a wheel's diameter may be, relative
    track_scale_sigma: NotNegative = 0.02  # and the width between the wheels
    gyro_noise_rad_per_sqrt_s: Positive = 0.001
    gyro_bias_sigma_radps: NotNegative = 0.02  # before the first standstill
    gyro_bias_walk: NotNegative = 0.00002  # rad/s per sqrt(s)
    slip_chi2: Positive = 12.0  # above: the wheels turned without the floor
    # the filter
    invariant: bool = True  # errors turn with the heading: an honest one, see ekf.py
    # association
    range_noise_factor: Positive = 4.0  # on variances of landmarks, as errors last many frames
    bearing_noise_factor: Positive = 4.0
    view_sigma_m: NotNegative = 0.02  # a landmark found again is not quite the same point
    marker_range_m: Positive = 0.9  # farther, a marker looks smaller than it is
    marker_noise_factor: Positive = 4.0
    gate_chi2: Positive = 11.8  # two degrees of freedom
    huber_chi2: Positive = 4.0  # beyond, a sight counts less
    height_gate_m: Positive = 0.05
    height_gate_slope: NotNegative = 0.04  # metres per metre of range
    max_hamming: Annotated[int, Meta(ge=0, le=256)] = 60  # of 256 bits
    hamming_weight: NotNegative = 0.1  # chi2 per bit
    ambiguity: NotNegative = 2.0  # a second choice must cost this much more
    consensus: Count = 4  # agreeing pairs before a landmark is found again
    # the map
    max_landmarks: Count = 180  # awake; the farther ones sleep
    landmarks_per_m2: Count = 6  # kept where they are more than the filter can hold
    max_observations: Count = 30  # used of one frame
    provisional_sightings: Count = 6
    init_range_m: Positive = 3.0
    spacing_m: NotNegative = 0.15
    sectors: Count = 6
    landmarks_per_sector: Count = 4
    min_move_m: NotNegative = 0.02  # a frame from the same place teaches nothing
    min_turn_rad: NotNegative = 0.03
    # finding itself
    max_places: Count = 4000  # points by which rooms are recognised
    place_sightings: Count = 6  # of a point before it becomes one
    # health
    degraded_sigma_m: Positive = 0.3  # one sigma of the position along its worse direction
    lost_sigma_m: Positive = 1.0


class MappingConfig(Section):
    """The occupancy grid."""

    resolution_m: Annotated[float, Meta(gt=0.0, le=0.2)] = 0.025
    max_range_m: Annotated[float, Meta(gt=0.2, le=10.0)] = 3.0  # farther ranges only say "free"
    trusted_range_m: Positive = 0.8  # evidence fades with the square of the distance beyond
    range_sigma_per_m2: NotNegative = 0.022  # sigma_z = this * z^2 (0.3 px at 228 px, 6 cm)
    min_thickness_m: Positive = 0.05  # what is hit is taken to be at least so deep
    free_weight: Positive = 0.4  # log-odds that one scan takes from a free cell ...
    hit_weight: Positive = 0.5  # ... and gives to an occupied one
    hit_over_free: Annotated[float, Meta(ge=1.0)] = 1.5  # weight of a hit among rays that pass
    free_below: Positive = 0.3  # log-odds under minus this: free
    occupied_above: Positive = 0.6
    max_free: Positive = 2.5  # bounded, so that a door that closes is believed within a second
    max_occupied: Positive = 3.5
    max_extent_m: Positive = 60.0  # nothing farther from the start is mapped


class PlanningConfig(Section):
    """Coverage and routes."""

    margin_m: NotNegative = 0.014  # kept between the robot's rim and what is mapped
    thin_margin_m: NotNegative = 0.008  # more of it beside legs and other thin things
    min_passage_m: NotNegative = 0.06  # room to spare in a gap that leads to a small place only
    unknown_clearance_m: NotNegative = 0.08  # kept between the centre and unseen floor
    lane_overlap_m: NotNegative = 0.01  # neighbouring lanes share this much of the brush
    soft_clearance_m: Positive = 0.35  # routes prefer this much room around the centre
    min_patch_m2: Positive = 0.01  # uncovered specks smaller than this are left
    min_sliver_m: NotNegative = 0.05  # and strips thinner than this
    worth_m2_per_m: NotNegative = 0.02  # floor that makes up for a metre of way to it
    horizon_m: NotNegative = 8.0  # paths end about there while the map grows; 0: never
    min_unseen_m2: Positive = 0.03  # smallest unseen floor worth a look
    turn_cost_m: NotNegative = (
        0.25  # a turn on the spot by 90 degrees costs as much as driving this
    )


class ControlConfig(Section):
    """Following and the safety gate."""

    acceleration_mps2: Positive = 0.6
    brake_mps2: Positive = 0.6  # what the drive can surely do; plans and the gate count on it
    yaw_acceleration_radps2: Positive = 8.0
    lookahead_m: Positive = 0.18  # a lateral error is steered away within about this distance
    heading_gain_per_s: Positive = 4.0
    drive_lag_s: NotNegative = 0.08  # from a command to the wheels
    corner_radius_m: NotNegative = 0.09  # turns between neighbouring lanes are driven round
    corner_cut_m: NotNegative = 0.01  # how far any other corner may be cut
    turn_in_place_rad: Positive = 0.6  # a larger heading error is turned away standing
    valid_for_ms: Annotated[int, Meta(ge=20, le=1000)] = 200
    wheels_stale_s: Positive = 0.3
    contact_stale_s: Positive = 0.5
    link_stale_s: Positive = 1.5
    seen_slow_s: Positive = 0.5
    seen_stop_s: Positive = 1.5
    stale_mps: NotNegative = 0.10
    unknown_mps: NotNegative = 0.12
    near_mps: NotNegative = 0.22  # beside something; it is met with less than half the speed
    touch_mps: Annotated[float, Meta(gt=0.0, le=0.15)] = 0.08  # with no free distance left
    back_mps: Annotated[float, Meta(gt=0.0, le=0.15)] = 0.12
    reaction_s: NotNegative = 0.2
    stop_gap_m: NotNegative = 0.02
    graze_m: NotNegative = 0.02
    memory_s: Positive = 12.0  # how long a seen obstacle is remembered without being seen again
    free_memory_s: Positive = 4.0  # how long seen free floor is believed to have stayed free
    memory_range_m: Positive = 1.2
    no_go_margin_m: NotNegative = 0.03  # kept between the footprint and what people forbade
    wheel_only_mps: Annotated[float, Meta(gt=0.0, le=0.1)] = 0.10  # without sight
    manual_expires_s: Annotated[float, Meta(gt=0.0, le=0.3)] = 0.2  # the dead man's handle


class MissionConfig(Section):
    """What a cleaning run does."""

    max_duration_s: Positive = 3600.0  # of cleaning; then the robot returns to its dock
    battery_return_pct: Annotated[float, Meta(ge=0.0, le=100.0)] = 20.0
    battery_stop_pct: Annotated[float, Meta(ge=0.0, le=100.0)] = 5.0  # stop where it is
    battery_resume_pct: Annotated[float, Meta(ge=0.0, le=100.0)] = 80.0  # go on after charging
    undock_m: Positive = 0.45
    look_radps: Positive = 0.8
    replan_growth_m2: Positive = 1.5  # known free floor gained that is worth a new plan
    replan_every_s: Positive = 20.0  # at most so often for growth
    plan_timeout_s: Positive = 10.0
    done_m2: NotNegative = 0.05  # less uncovered floor than this is clean
    fruitless_plans: Count = 3  # so many plans in a row without new floor end the cleaning
    fruitful_m2: NotNegative = 0.05
    staging_m: Positive = 0.7  # where the approach to the dock begins, before the docked pose
    dock_tries: Count = 3
    back_off_m: Annotated[float, Meta(gt=0.0, le=0.3)] = 0.10
    stuck_s: Positive = 4.0
    denied_give_up_s: Positive = 30.0  # the gate lets nothing move for so long: an error
    recover_tries: Count = 8  # within `recover_reset_m` of driving
    recover_reset_m: Positive = 0.5
    recover_limit_s: Positive = 35.0  # from the first try to the last
    recover_limit_m: Positive = 1.5  # backed off in all of them
    no_way_s: Positive = 22.0  # without a route to the dock before it says so
    blind_after_s: Positive = 2.5  # so long without sight is no hiccup
    blind_wait_s: Positive = 6.0  # sight may come back by itself
    blind_quality: Fraction = 0.03  # of a frame; less is darkness
    blind_limit_m: Positive = 12.0  # farther by the wheels alone it may be anywhere
    blind_limit_s: Positive = 150.0
    no_go_margin_m: NotNegative = 0.05  # plans keep so far off what people forbade
    brush: Fraction = 0.8
    fan: Fraction = 0.8  # at its level "high"


class LinkConfig(Section):
    """The serial bridge to the motor controller."""

    port: str = ""  # empty: find it by its USB name
    baud: Count = 115200
    metres_per_tick: Annotated[float, Meta(gt=0.0, le=0.01)] = 0.0002  # 5000 ticks a metre
    max_wheel_mps: Annotated[float, Meta(gt=0.0, le=0.5)] = 0.5  # rim speed, each wheel
    full_speed_mps: Annotated[float, Meta(ge=0.1, le=2.0)] = 0.6  # of a free wheel at full power
    battery_empty_v: Positive = 12.0  # 0 % of a pack of four lithium-ion cells
    battery_full_v: Positive = 16.4  # 100 %


class LogConfig(Section):
    """What is kept of a run."""

    chunk_bytes: Count = 262144  # what a crash can lose at most, before compression
    # Channels for people only, per second; 0: never. Events and commands are always complete.
    pose_hz: NotNegative = 10.0
    scan_hz: NotNegative = 5.0
    map_hz: NotNegative = 0.5
    landmarks_hz: NotNegative = 0.2


class SimConfig(Section):
    """The built-in simulator's imperfections. A seed draws within these limits."""

    wheel_scale_error: Fraction = 0.01
    motor_mismatch: Fraction = 0.04
    motor_lag_s: Positive = 0.07
    encoder_noise: NotNegative = 0.0005  # m of 1 sigma a square root of a metre
    slip_every_s: NotNegative = 20.0  # mean time between slips; 0: none
    slip_share: Fraction = 0.5  # at most, of the rolled distance
    gyro_bias_radps: NotNegative = 0.01
    gyro_walk: NotNegative = 1e-5  # rad/s a square root of a second
    gyro_noise_radps: NotNegative = 0.003
    image_noise: NotNegative = 2.0  # grey levels
    exposure_difference: Fraction = 0.05
    vertical_shift_px: NotNegative = 0.3
    vignetting: Fraction = 0.15


class Config(Section):
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
