"""What travels through the robot, on one page: events in, commands and reports out.

Time is `t_ns`, host monotonic nanoseconds of when it happened; `arrived_ns` says when the brain
could first know, where the two differ. NaN means unknown, never 0. Arrays are never mutated.
Rates are what a healthy robot delivers; staleness is judged against them (`RATE_HZ`).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from robot.geometry.se2 import SE2

NAN = float("nan")

# ---------------------------------------------------------------- frames (never in the loop's log)


@dataclass(frozen=True, slots=True, eq=False)
class StereoFrame:
    """One synchronised pair of grey uint8 images (h, w), as the camera delivers them."""

    t_ns: int
    seq: int
    left: np.ndarray
    right: np.ndarray
    yaw_change_rad: float = NAN  # gyro yaw since the previous frame: a hint for tracking


@dataclass(frozen=True, slots=True, eq=False)
class DisparityMap:
    """Dense result of a matcher on a rectified pair: float32 (h, w), NaN where unknown."""

    t_ns: int
    disparity_px: np.ndarray
    confidence: np.ndarray  # 0 to 1


# ---------------------------------------------------------------- events


@dataclass(frozen=True, slots=True)
class Tick:
    """The control beat (50 Hz): commands leave on it."""

    t_ns: int


@dataclass(frozen=True, slots=True)
class WheelTravel:
    """Distance rolled by each wheel since start (50 Hz), cumulative: a lost one costs nothing."""

    t_ns: int
    arrived_ns: int
    left_m: float
    right_m: float


@dataclass(frozen=True, slots=True)
class ImuSample:
    """Turn rate about z (50 Hz), bias not removed."""

    t_ns: int
    yaw_rate_radps: float


@dataclass(frozen=True, slots=True)
class Contact:
    """Touch and drop switches (50 Hz, and at once on change)."""

    t_ns: int
    bump_left: bool = False
    bump_right: bool = False
    cliff: bool = False
    wheel_drop: bool = False
    charging: bool = False
    cliff_sensors: int = 0  # which of them see no floor: bits, the leftmost sensor's is 1


@dataclass(frozen=True, slots=True)
class Battery:
    """State of the battery (1 Hz)."""

    t_ns: int
    voltage_v: float
    charge_pct: float


@dataclass(frozen=True, slots=True)
class LinkState:
    """Health of the serial link and the motor controller's latch (5 Hz, and at once on change)."""

    t_ns: int
    connected: bool
    stop_reason: str = ""  # empty: the controller accepts orders
    crc_errors: int = 0
    retries: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Landmark:
    """A point seen again: polar in `base` at the frame's time, with its covariance.

    `cov` is 2x2 over (range_m, bearing_rad). `signature` is a 32-byte binary descriptor compared
    by Hamming distance; for a marker it holds the marker's id. `track_id` is the same number in
    consecutive frames while the point is followed, and never used again afterwards.
    """

    range_m: float
    bearing_rad: float
    cov: np.ndarray
    signature: bytes
    kind: Literal["point", "edge", "marker"] = "point"
    height_m: float = NAN
    track_id: int = -1


@dataclass(frozen=True, slots=True, eq=False)
class Scan:
    """What stands above the floor, as polar arrays (n,) in `base`, bearings ascending.

    `range_m` is the nearest obstacle (NaN: none seen); `clear_m` is how far floor was seen free on
    that bearing (0: nothing known).
    """

    bearing_rad: np.ndarray
    range_m: np.ndarray
    clear_m: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class VisualMotion:
    """Planar motion of `base` since the previous frame, from stereo: cov 3x3 of (x, y, yaw)."""

    previous_from_current: SE2
    cov: np.ndarray
    inliers: int


@dataclass(frozen=True, slots=True, eq=False)
class Marker:
    """The dock's marker, seen: its pose in `base` (x out of the marker's face)."""

    marker_id: int
    base_from_marker: SE2
    cov: np.ndarray  # 3x3 of (x_m, y_m, yaw_rad)


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """Everything perception has to say about one frame (10 Hz)."""

    t_ns: int
    arrived_ns: int
    seq: int
    landmarks: tuple[Landmark, ...]
    scan: Scan
    quality: float  # 0 to 1: share of the image with trusted disparity
    motion: VisualMotion | None = None
    marker: Marker | None = None
    stage_ms: dict[str, float] = field(default_factory=dict)  # for the log and the summary only


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """Occupancy in `world`: int8 (rows = y, columns = x), -1 unknown, else percent filled.

    A cell is free below 50 and occupied from there on; between 0 and 100 a face stands in it.
    """

    resolution_m: float
    origin_x_m: float  # outer corner of cell (0, 0)
    origin_y_m: float
    cells: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """Waypoints (n, 2) in `world`, metres, to be driven in order."""

    points_m: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Planned:
    """Answer to a `PlanOrder`. An empty path means: nothing (more) to do there."""

    t_ns: int
    order_id: int
    path: Path
    remaining_m2: float  # reachable known floor that is still uncovered
    reason: str = ""
    rooms: np.ndarray | None = None  # to "rooms" only: uint8 of the grid's shape, 0: no room
    reached_m2: float = NAN  # floor that need not be swept (again), but could be reached


@dataclass(frozen=True, slots=True)
class Request:
    """What a person (or the schedule) asks for: a verb of `robot.mission.verbs`.

    Its `Answer` names the same `request_id`; 0 belongs to requests that nobody waits for.
    """

    t_ns: int
    verb: str
    args: tuple[str, ...] = ()
    request_id: int = 0


Event = Tick | WheelTravel | ImuSample | Contact | Battery | LinkState | Seen | Planned | Request

# ---------------------------------------------------------------- commands


@dataclass(frozen=True, slots=True)
class DriveCommand:
    """One order for wheels and brushes (50 Hz); it expires by itself."""

    t_ns: int
    v_mps: float
    yaw_rate_radps: float
    brush: float  # 0 to 1
    fan: float  # 0 to 1
    valid_for_ms: int
    reason: str


@dataclass(frozen=True, slots=True)
class StopOrder:
    """Latch a stop in the motor controller."""

    t_ns: int
    reason: str


@dataclass(frozen=True, slots=True)
class ClearOrder:
    """Clear the motor controller's latch, on purpose and with a reason."""

    t_ns: int
    reason: str


@dataclass(frozen=True, slots=True, eq=False)
class PlanOrder:
    """Ask the planning worker for a path over a snapshot of the map, or for its rooms.

    `covered` is bool, of the grid's shape, and `lost_pct` uint8: what wheels lose there by slip.
    `goal` is used by "route" only. Unless `explore`, floor not known yet is left alone.
    """

    t_ns: int
    order_id: int
    kind: Literal["coverage", "route", "rooms"]
    grid: Grid
    covered: np.ndarray
    start: SE2
    goal: SE2 | None = None
    explore: bool = True
    lost_pct: np.ndarray | None = None


@dataclass(frozen=True, slots=True)
class Beep:
    """Let the robot be heard, so that people find it."""

    t_ns: int


# ---------------------------------------------------------------- reports (commands to nobody)


@dataclass(frozen=True, slots=True, eq=False)
class PoseEstimate:
    """Where the robot is (10 Hz): cov 3x3 of (x, y, yaw) in `world`.

    `degraded` is not sure: too vague, or, at home, nothing familiar since all followed ended.
    """

    t_ns: int
    world_from_base: SE2
    cov: np.ndarray
    health: Literal["ok", "degraded", "lost"]


@dataclass(frozen=True, slots=True, eq=False)
class MapReport:
    """The map for people (0.5 Hz): grid, swept cells, landmarks (n, 2) with cov (n, 2, 2)."""

    t_ns: int
    grid: Grid
    covered: np.ndarray
    landmarks_m: np.ndarray
    landmark_cov: np.ndarray


@dataclass(frozen=True, slots=True)
class MissionState:
    """What the robot is doing and why, in words (on change, and 1 Hz)."""

    t_ns: int
    state: str
    reason: str
    covered_m2: float
    remaining_m2: float


@dataclass(frozen=True, slots=True)
class Answer:
    """What became of a `Request`: whether it is carried out, and why (not).

    `data` is JSON text for programs, empty where the sentence says it all.
    """

    t_ns: int
    request_id: int
    verb: str
    accepted: bool
    reason: str
    data: str = ""


Command = (
    DriveCommand
    | StopOrder
    | ClearOrder
    | PlanOrder
    | Beep
    | PoseEstimate
    | MapReport
    | MissionState
    | Answer
)

RATE_HZ: dict[type, float] = {
    Tick: 50.0,
    WheelTravel: 50.0,
    ImuSample: 50.0,
    Contact: 50.0,
    Battery: 1.0,
    LinkState: 5.0,
    Seen: 10.0,
    DriveCommand: 50.0,
    PoseEstimate: 10.0,
    MapReport: 0.5,
    MissionState: 1.0,
}
