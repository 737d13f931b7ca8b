"""Which of the robot's messages people get to see in a viewer, and how often.

Frames (REP-105): `map` is the estimate's `world`; `odom` drifts but never jumps, it is dead
reckoning from the wheels alone; `base_link` is `base`; `camera_left` is `cam`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms

from robot.config import LogConfig, RobotConfig
from robot.geometry.se2 import SE2, exp
from robot.geometry.stereo import StereoCamera
from robot.log import foxglove
from robot.messages import (
    ClearOrder,
    Command,
    Event,
    MapReport,
    MissionState,
    Planned,
    PoseEstimate,
    Request,
    Seen,
    StopOrder,
    WheelTravel,
)

NS = 1_000_000_000
Put = Callable[[str, Any, int], None]  # topic, protobuf message, t_ns


class Beat:
    """Lets through at most `rate_hz` a second of robot time; 0 lets nothing through."""

    def __init__(self, rate_hz: float) -> None:
        self._period_ns = NS / rate_hz if rate_hz > 0.0 else None
        self._due_ns: float | None = None

    def due(self, t_ns: int) -> bool:
        """Whether a message of this time is to be shown."""
        if self._period_ns is None or (self._due_ns is not None and t_ns < self._due_ns):
            return False
        # Keep the grid of times, so that 10 Hz input at 10 Hz is not halved by a late message.
        late = self._due_ns is None or t_ns >= self._due_ns + self._period_ns
        self._due_ns = (t_ns if late else self._due_ns or 0.0) + self._period_ns
        return True


class PeopleChannels:
    """Turns events, commands and truth into messages on Foxglove's topics."""

    def __init__(
        self, put: Put, config: LogConfig, robot: RobotConfig, camera: StereoCamera | None
    ) -> None:
        self._put = put
        self._camera = camera
        self._track_width_m = robot.track_width_m
        self._scan, self._pose = Beat(config.scan_hz), Beat(config.pose_hz)
        self._map, self._landmarks = Beat(config.map_hz), Beat(config.landmarks_hz)
        self._truth = Beat(config.pose_hz)
        self._odom_from_base = SE2()
        self._wheels_m: tuple[float, float] | None = None
        self._mission = ("", "")

    def event(self, event: Event, t_ns: int) -> None:
        """Show what is worth seeing of an event."""
        if isinstance(event, WheelTravel):
            self._roll(event)
        elif isinstance(event, Seen):
            if self._scan.due(event.t_ns):
                self._put("/scan", foxglove.laser_scan(event.t_ns, event.scan), t_ns)
        elif isinstance(event, Planned):
            self._put("/path", foxglove.path_poses(t_ns, event.path), t_ns)
        elif isinstance(event, Request):
            text = " ".join(("asked to", event.verb, *event.args))
            self._put("/diagnostics", foxglove.log_line(t_ns, text), t_ns)

    def command(self, command: Command, t_ns: int) -> None:
        """Show what is worth seeing of a command or report."""
        if isinstance(command, PoseEstimate):
            if self._pose.due(command.t_ns):
                self._show_pose(command, t_ns)
        elif isinstance(command, MapReport):
            self._show_map(command, t_ns)
        elif isinstance(command, MissionState):
            if self._mission != (command.state, command.reason):
                self._mission = (command.state, command.reason)
                text = f"{command.state}: {command.reason}"
                self._put("/diagnostics", foxglove.log_line(t_ns, text), t_ns)
        elif isinstance(command, StopOrder | ClearOrder):
            word = "stop" if isinstance(command, StopOrder) else "clear the stop"
            line = foxglove.log_line(t_ns, f"{word}: {command.reason}", warning=True)
            self._put("/diagnostics", line, t_ns)

    def truth(self, t_ns: int, world_from_base: SE2) -> None:
        """Show where the robot really is."""
        if self._truth.due(t_ns):
            self._put("/truth", foxglove.pose_in_frame(t_ns, world_from_base), t_ns)

    def _roll(self, travel: WheelTravel) -> None:
        """Dead reckoning of the differential drive (Siciliano et al., Robotics, 2009, 11.2)."""
        now = (travel.left_m, travel.right_m)
        if self._wheels_m is not None:
            left, right = now[0] - self._wheels_m[0], now[1] - self._wheels_m[1]
            step = exp(0.5 * (left + right), 0.0, (right - left) / self._track_width_m)
            self._odom_from_base = self._odom_from_base @ step
        self._wheels_m = now

    def _show_pose(self, estimate: PoseEstimate, t_ns: int) -> None:
        map_from_base = estimate.world_from_base
        map_from_odom = map_from_base @ self._odom_from_base.inverse()
        transforms = [
            foxglove.planar_transform(t_ns, foxglove.MAP, foxglove.ODOM, map_from_odom),
            foxglove.planar_transform(t_ns, foxglove.ODOM, foxglove.BASE, self._odom_from_base),
        ]
        if self._camera is not None:
            transforms.append(foxglove.camera_transform(t_ns, self._camera.base_from_cam))
        self._put("/tf", FrameTransforms(transforms=transforms), t_ns)
        self._put("/pose", foxglove.pose_in_frame(estimate.t_ns, map_from_base), t_ns)

    def _show_map(self, report: MapReport, t_ns: int) -> None:
        if self._map.due(report.t_ns):
            self._put("/map", foxglove.map_grid(t_ns, report.grid, report.covered), t_ns)
        if self._landmarks.due(report.t_ns):
            self._put("/landmarks", foxglove.landmark_scene(t_ns, report), t_ns)
