"""The dock's marker over many frames: where the docked pose lies, as well as it is known.

One sighting of a small marker tells its position well and its direction badly. Sightings are
averaged in the odometry frame with the inverse of their variance as weight. Where the marker stands
relative to the docked robot is learned while undocking, when the robot knows where it is.
"""

from __future__ import annotations

import math
from collections import deque

from robot.config import RobotConfig
from robot.geometry.se2 import SE2, wrap_angle
from robot.messages import Marker

KEEP_NS = 20_000_000_000
KEEP_SIGHTINGS = 40
MIN_SIGMA_M, MIN_SIGMA_RAD = 0.004, 0.02
AVERAGED_YAW_SIGMA_RAD = 0.04  # neighbouring frames err alike: averaging gets no better than this
UNSEEN_MARKER_M = 0.05  # behind the robot's front, when the dock's shape was never learned


class DockSight:
    """Short memory of marker sightings, and the lasting knowledge of the dock's shape."""

    def __init__(self, robot: RobotConfig) -> None:
        self._marker_id = robot.dock_marker_id
        self._sightings: deque[tuple[int, SE2, float, float]] = deque(maxlen=KEEP_SIGHTINGS)
        self.seen_ns: int | None = None
        self.docked_from_marker = SE2(robot.radius_m + UNSEEN_MARKER_M, 0.0, math.pi)
        self.world_from_docked: SE2 | None = None  # the map's place of the dock, None: unknown

    def see(self, t_ns: int, marker: Marker, odom_from_base: SE2, world_from_base: SE2) -> None:
        """Add a sighting; the poses are those of the time of the frame. Other markers are ignored.

        The first sighting tells the map where the dock is, if the robot did not start on it.
        """
        if marker.marker_id != self._marker_id:
            return
        var_m2 = max(MIN_SIGMA_M**2, 0.5 * float(marker.cov[0, 0] + marker.cov[1, 1]))
        var_rad2 = max(MIN_SIGMA_RAD**2, float(marker.cov[2, 2]))
        pose = odom_from_base @ marker.base_from_marker
        if not math.isfinite(pose.x_m + pose.y_m + pose.yaw_rad + var_m2 + var_rad2):
            return
        self.seen_ns = t_ns
        self._sightings.append((t_ns, pose, 1.0 / var_m2, 1.0 / var_rad2))
        if self.world_from_docked is None:
            world_from_marker = world_from_base @ marker.base_from_marker
            self.world_from_docked = world_from_marker @ self.docked_from_marker.inverse()

    def forget(self) -> None:
        """Drop the sightings, keep the dock's shape."""
        self._sightings.clear()

    def sightings(self, since_ns: int) -> int:
        """How many sightings are not older than `since_ns`."""
        return sum(t_ns >= since_ns for t_ns, *_ in self._sightings)

    def marker(self, now_ns: int) -> SE2 | None:
        """odom_from_marker, averaged over the last sightings; None without any."""
        recent = [s for s in self._sightings if s[0] >= now_ns - KEEP_NS]
        if not recent:
            return None
        first = recent[0][1]
        weight_m = sum(s[2] for s in recent)
        weight_rad = sum(s[3] for s in recent)
        return SE2(
            sum(s[2] * s[1].x_m for s in recent) / weight_m,
            sum(s[2] * s[1].y_m for s in recent) / weight_m,
            wrap_angle(
                first.yaw_rad
                + sum(s[3] * wrap_angle(s[1].yaw_rad - first.yaw_rad) for s in recent) / weight_rad
            ),
        )

    def learn(self, now_ns: int, odom_from_docked: SE2) -> bool:
        """Note where the marker stands relative to the docked robot; False if it was not seen."""
        marker = self.marker(now_ns)
        if marker is None:
            return False
        self.docked_from_marker = odom_from_docked.inverse() @ marker
        return True

    def docked(self, now_ns: int, map_yaw_rad: float, map_sigma_rad: float) -> SE2 | None:
        """odom_from_docked from the marker's position and the best guess of its direction.

        `map_yaw_rad` is the docked robot's heading in odom by the map, with its sigma.
        """
        marker = self.marker(now_ns)
        if marker is None:
            return None
        from_marker = self.docked_from_marker.inverse()
        seen_yaw = wrap_angle(marker.yaw_rad + from_marker.yaw_rad)
        share = AVERAGED_YAW_SIGMA_RAD**2 / (AVERAGED_YAW_SIGMA_RAD**2 + map_sigma_rad**2)
        yaw = wrap_angle(seen_yaw + share * wrap_angle(map_yaw_rad - seen_yaw))
        level = SE2(marker.x_m, marker.y_m, wrap_angle(yaw - from_marker.yaw_rad))
        return level @ from_marker
