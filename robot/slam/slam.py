"""Where am I: odometry in, frames in, a pose for any time out."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from robot.config import RobotConfig, SlamConfig
from robot.geometry.se2 import SE2, exp
from robot.messages import ImuSample, PoseEstimate, Seen, WheelTravel
from robot.slam.history import Mark, OdometryBuffer, PoseHistory
from robot.slam.motion import Increment, OdometryNoise, compose, visual_increment, wheel_increment

_LAG_NS = 2_000_000_000  # without frames the filter follows the odometry this far behind
_COAST_NS = 200_000_000  # without odometry the last speed is believed for this long
_BLIND_MPS, _BLIND_RADPS = 0.3, 1.0  # how fast the robot may move when nothing measures it


class Slam:
    """EKF-SLAM in the frame where the robot started. Pure: fed by events, asked by time."""

    def __init__(self, config: SlamConfig, robot: RobotConfig) -> None:
        from robot.slam.ekf import LandmarkFilter

        self._config = config
        self._noise = OdometryNoise(
            config.wheel_noise_m_per_sqrt_m, config.gyro_noise_rad_per_sqrt_s, robot.track_width_m
        )
        scale = config.wheel_scale_sigma
        sigma = [1e-4, 1e-4, 1e-4, config.gyro_bias_sigma_radps, scale, scale, 1.0, 1.0, 1.0]
        self._filter = LandmarkFilter(np.array(sigma))
        self._buffer = OdometryBuffer()
        self._history = PoseHistory()
        self._mark: Mark | None = None
        self._twist = (0.0, 0.0, 0.0)  # per second, for coasting

    def odometry(self, event: WheelTravel | ImuSample) -> None:
        """Take in wheel travel or a turn rate; cheap, the filter moves at the next frame."""
        if isinstance(event, WheelTravel):
            self._buffer.add_wheels(event.t_ns, event.left_m, event.right_m)
        else:
            self._buffer.add_gyro(event.t_ns, event.yaw_rate_radps)
        if self._mark is None:
            self._start(event.t_ns)
        elif event.t_ns - self._mark.t_ns > _LAG_NS:
            self._advance(event.t_ns - _LAG_NS // 2, None)

    def see(self, seen: Seen) -> PoseEstimate:
        """Move to the time of the frame and correct the pose by what it shows.

        A frame older than the last one corrects nothing.
        """
        if self._mark is None:
            self._start(seen.t_ns)
        elif seen.t_ns > self._mark.t_ns:
            self._advance(seen.t_ns, seen)
        return self.pose_at(seen.t_ns)

    def pose_at(self, t_ns: int) -> PoseEstimate:
        """Pose at any time: past ones from the history, later ones by odometry since the frame."""
        if self._mark is None:
            return self._estimate(t_ns, SE2(), self._filter.P[:3, :3].copy())
        if t_ns <= self._mark.t_ns:
            return self._estimate(t_ns, *self._history.at(t_ns))
        increment = self._increment(t_ns, None)
        if increment is None:
            ahead_s = min(t_ns - self._mark.t_ns, _COAST_NS) * 1e-9
            increment = self._blind(exp(*(ahead_s * rate for rate in self._twist)), ahead_s)
        end, by_pose, by_increment = compose(self._filter.x[:3], increment.previous_from_current)
        by_calibration = by_increment @ increment.calibration_jacobian
        jacobian = np.hstack([by_pose, by_calibration])
        cov = jacobian @ self._filter.P[:6, :6] @ jacobian.T
        cov += by_increment @ increment.cov @ by_increment.T
        return self._estimate(t_ns, SE2(*end.tolist()), cov)

    def landmarks(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions (n, 2) in `world` and covariances (n, 2, 2) of the landmarks in the filter."""
        return self._filter.landmarks(), self._filter.landmark_covs()

    def _start(self, t_ns: int) -> None:
        self._mark = self._buffer.mark(t_ns)
        self._remember()

    def _advance(self, t_ns: int, seen: Seen | None) -> None:
        assert self._mark is not None
        span_s = (t_ns - self._mark.t_ns) * 1e-9
        increment = self._increment(t_ns, seen)
        if increment is None:
            increment = self._blind(SE2(), span_s)
        end, by_pose, by_increment = compose(self._filter.x[:3], increment.previous_from_current)
        self._filter.predict(
            end,
            by_pose,
            by_increment @ increment.calibration_jacobian,
            by_increment @ increment.cov @ by_increment.T,
            np.array([self._config.gyro_bias_walk**2 * span_s, 0.0, 0.0]),
        )
        x, y, yaw = increment.previous_from_current.log()
        self._twist = (x / span_s, y / span_s, yaw / span_s)
        self._mark = self._buffer.mark(t_ns)
        self._remember()

    def _increment(self, t_ns: int, seen: Seen | None) -> Increment | None:
        """Motion since the filter's time from the best source there is, None without any."""
        mark = self._mark
        assert mark is not None
        if self._buffer.has_wheels(mark.t_ns, t_ns):
            return wheel_increment(self._buffer.steps(mark, t_ns), self._filter.x[3:6], self._noise)
        if seen is not None and seen.motion is not None:
            gyro = self._buffer.gyro_yaw_rad(mark, t_ns)
            var = self._noise.gyro_rad_per_sqrt_s**2 * (t_ns - mark.t_ns) * 1e-9
            return visual_increment(seen.motion.previous_from_current, seen.motion.cov, gyro, var)
        return None

    @staticmethod
    def _blind(motion: SE2, span_s: float) -> Increment:
        wide = np.array([_BLIND_MPS, _BLIND_MPS, _BLIND_RADPS]) * span_s
        return Increment(motion, np.zeros((3, 3)), np.diag(wide**2))

    def _remember(self) -> None:
        assert self._mark is not None
        pose = SE2(*self._filter.x[:3].tolist())
        self._history.append(self._mark.t_ns, pose, self._filter.P[:3, :3].copy())

    def _estimate(self, t_ns: int, pose: SE2, cov: np.ndarray) -> PoseEstimate:
        cov = 0.5 * (cov + cov.T)
        sigma_m = math.sqrt(max(float(np.linalg.eigvalsh(cov[:2, :2])[-1]), 0.0))
        health: Literal["ok", "degraded", "lost"] = "ok"
        if sigma_m > self._config.lost_sigma_m:
            health = "lost"
        elif sigma_m > self._config.degraded_sigma_m:
            health = "degraded"
        return PoseEstimate(t_ns, pose, cov, health)
