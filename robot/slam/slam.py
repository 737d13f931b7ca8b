"""Where am I: odometry in, frames in, a pose for any time out."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from robot.config import RobotConfig, SlamConfig
from robot.geometry.se2 import SE2, exp
from robot.messages import ImuSample, PoseEstimate, Seen, WheelTravel
from robot.slam.catalogue import collect
from robot.slam.finding import FAMILIAR_NS, FOUND_COV, Fits, SelfFinder
from robot.slam.history import Mark, PoseHistory
from robot.slam.memory import SlamMemory, remember, restore
from robot.slam.motion import compose
from robot.slam.odometry import Odometry

_LAG_NS = 2_000_000_000  # without frames the filter follows the odometry this far behind
_COAST_NS = 200_000_000  # without odometry the last speed is believed for this long
_MARKER_SIGMA = 1.0  # m and rad, replaced by the first sight
_START_SIGMA = 1e-4  # m and rad: the start defines the frame


class Slam:
    """EKF-SLAM in the frame where the robot started. Pure: fed by events, asked by time."""

    def __init__(
        self, config: SlamConfig, robot: RobotConfig, memory: SlamMemory | None = None
    ) -> None:
        """With `memory` the robot knows a map, but not where in it it stands: see `put`."""
        from robot.slam.calibration import Calibrator
        from robot.slam.ekf import LandmarkFilter  # filterpy takes a second to import
        from robot.slam.landmark_map import LandmarkMap

        self._config = config
        scale, track = config.wheel_scale_sigma, config.track_scale_sigma
        sigma = [_START_SIGMA] * 3 + [config.gyro_bias_sigma_radps, scale, scale, track]
        self._ekf = LandmarkFilter(np.array(sigma + [_MARKER_SIGMA] * 3), config.invariant)
        self._map = LandmarkMap(config, self._ekf)
        self._finder = SelfFinder(config, None if memory is None else memory.places)
        if memory is not None:
            restore(memory, self._ekf, self._map)
            self._finder.lose()
        self._odometry = Odometry(config, robot)
        self._calibrator = Calibrator(config, robot, self._ekf)
        self._history = PoseHistory()
        self._mark: Mark | None = None
        self._seen_ns = -1  # when the last frame was taken
        self._twist = (0.0, 0.0, 0.0)  # per second, for coasting
        self._ahead_m = self._moved_m = self._turned_rad = 0.0  # since the last correction

    def odometry(self, event: WheelTravel | ImuSample) -> None:
        """Take in wheel travel or a turn rate; cheap, the filter moves at the next frame."""
        if isinstance(event, WheelTravel):
            self._odometry.buffer.add_wheels(event.t_ns, event.left_m, event.right_m)
        else:
            self._odometry.buffer.add_gyro(event.t_ns, event.yaw_rate_radps)
        if self._mark is None:
            self._start(event.t_ns)
        elif event.t_ns - self._mark.t_ns > _LAG_NS:
            self._advance(event.t_ns - _LAG_NS // 2, None)
            self._remember()

    def see(self, seen: Seen, fits: Fits | None = None) -> PoseEstimate:
        """Move to the time of the frame and correct the pose by what it shows.

        A frame older than the last one corrects nothing. `fits` knows a map of matter: of what was
        seen lately up to this frame, the share that fits, were the robot at a pose.
        """
        if self._mark is None:
            self._start(seen.t_ns)
        elif seen.t_ns > self._mark.t_ns:
            self._advance(seen.t_ns, seen)
            if self._finder.lost:
                self._search(seen, fits)
            else:
                self._correct(seen, fits)
            self._remember()
        return self.pose_at(seen.t_ns)

    def pose_at(self, t_ns: int) -> PoseEstimate:
        """Pose at any time: past ones from the history, later ones by odometry since the frame."""
        if self._mark is None:
            return self._estimate(t_ns, SE2(), self._ekf.head()[:3, :3].copy())
        if t_ns <= self._mark.t_ns:
            return self._estimate(t_ns, *self._history.at(t_ns))
        interval = self._odometry.since(self._mark, t_ns, self._ekf.calibration)
        if interval is None:
            ahead_s = min(t_ns - self._mark.t_ns, _COAST_NS) * 1e-9
            interval = Odometry.blind(exp(*(ahead_s * rate for rate in self._twist)), ahead_s)
        increment = interval.increment
        end, by_pose, by_increment = compose(self._ekf.x[:3], increment.previous_from_current)
        jacobian = np.hstack([by_pose, by_increment @ increment.calibration_jacobian])
        cov = jacobian @ self._ekf.head()[:7, :7] @ jacobian.T
        cov += by_increment @ increment.cov @ by_increment.T
        return self._estimate(t_ns, SE2(*end.tolist()), cov)

    def landmarks(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions (n, 2) in `world` and covariances (n, 2, 2) of the landmarks in the filter."""
        return self._ekf.landmarks(), self._ekf.landmark_covs()

    def put(self, pose: SE2, cov: np.ndarray) -> None:
        """Somebody knows where the robot is now (on the dock): `pose`, covariance (3, 3)."""
        self._ekf.put(np.array([pose.x_m, pose.y_m, pose.yaw_rad]), cov)
        self._history.clear()
        if self._mark is not None:
            self._finder.found(self._mark.t_ns)
            self._remember()
        else:
            self._finder.found(0)

    def confirm(self, cov: np.ndarray) -> None:
        """Somebody knows that the pose is right as it stands, with covariance (3, 3)."""
        self.put(SE2(*self._ekf.x[:3].tolist()), cov)

    def lift(self) -> None:
        """The robot hangs in the air: wherever it is put down, its pose is unknown.

        To be said for as long as it hangs: what it sees meanwhile is forgotten again.
        """
        if not self._finder.lost:
            self._map.move_on(self._mark.t_ns if self._mark else 0)
        self._finder.lose()

    def memory(self) -> SlamMemory:
        """All that another run can begin with."""
        return remember(self._map, self._finder.places.points)

    def _search(self, seen: Seen, fits: Fits | None) -> None:
        """Lost: no correction by landmarks until places tell the pose for certain."""
        pose = self._finder.search(seen, fits)
        if pose is not None:
            self.put(pose, FOUND_COV)

    def _start(self, t_ns: int) -> None:
        self._mark = self._odometry.buffer.mark(t_ns)
        self._remember()

    def _advance(self, t_ns: int, seen: Seen | None) -> None:
        assert self._mark is not None
        span_s = (t_ns - self._mark.t_ns) * 1e-9
        visual = None if seen is None else seen.motion
        interval = self._odometry.since(self._mark, t_ns, self._ekf.calibration, visual)
        if interval is None:
            interval = Odometry.blind(SE2(), span_s)
        increment = interval.increment
        end, by_pose, by_increment = compose(self._ekf.x[:3], increment.previous_from_current)
        self._ekf.predict(
            end,
            by_pose,
            by_increment @ increment.calibration_jacobian,
            by_increment @ increment.cov @ by_increment.T,
            np.array([self._config.gyro_bias_walk**2 * span_s, 0.0, 0.0, 0.0]),
        )
        whole = not math.isnan(interval.left_m) and self._mark.t_ns == self._seen_ns
        self._calibrator.learn(interval, visual if whole else None)
        self._seen_ns = self._seen_ns if seen is None else t_ns
        self._finder.moved(increment.previous_from_current)
        x, y, yaw = increment.previous_from_current.log()
        self._twist = (x / span_s, y / span_s, yaw / span_s)
        self._ahead_m += x
        self._moved_m += math.hypot(x, y)
        self._turned_rad += abs(yaw)
        self._mark = self._odometry.buffer.mark(t_ns)

    def _correct(self, seen: Seen, fits: Fits | None) -> None:
        self._finder.follow(seen)
        if self._finder.lost:  # carried just now: what it has learned is right
            self._map.move_on(seen.t_ns)
            return
        moved = self._moved_m >= self._config.min_move_m
        moved |= self._turned_rad >= self._config.min_turn_rad
        if seen.marker is not None and (moved or not self._map.marker_known):
            self._map.correct_by_marker(seen.marker)
        if moved:
            observations = collect(
                seen.landmarks,
                self._config.range_noise_factor,
                self._config.bearing_noise_factor,
            )
            self._map.correct(observations, seen.t_ns, self._ahead_m)
            self._ahead_m = self._moved_m = self._turned_rad = 0.0
            familiar = self._map.familiar(seen.t_ns, FAMILIAR_NS)
            pose = SE2(*self._ekf.x[:3].tolist())
            self._finder.judge(seen, familiar, pose, self._ekf.head()[:3, :3], fits)
            if self._finder.lost:
                self._map.move_on(self._finder.placed_ns)

    def _remember(self) -> None:
        assert self._mark is not None
        pose = SE2(*self._ekf.x[:3].tolist())
        self._history.append(self._mark.t_ns, pose, self._ekf.head()[:3, :3].copy())

    def _estimate(self, t_ns: int, pose: SE2, cov: np.ndarray) -> PoseEstimate:
        cov = 0.5 * (cov + cov.T)
        sigma_m = math.sqrt(max(float(np.linalg.eigvalsh(cov[:2, :2])[-1]), 0.0))
        health: Literal["ok", "degraded", "lost"] = "ok"
        if self._finder.lost or sigma_m > self._config.lost_sigma_m:
            health = "lost"
        elif sigma_m > self._config.degraded_sigma_m or self._finder.unconfirmed:
            health = "degraded"
        return PoseEstimate(t_ns, pose, cov, health)
