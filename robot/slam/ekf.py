"""The filter: filterpy's ExtendedKalmanFilter with block-sparse steps and a state that grows.

This is the only file that knows filterpy's inside. State, in order:

    pose (x_m, y_m, yaw_rad) | calibration (4 of the motion model)
    | marker (x_m, y_m, yaw_rad) | landmarks (x_m, y_m) ...

A motion changes three rows and columns of the covariance and a measurement reads a handful of
columns, so a predict costs O(n) and an update O(n^2) where the dense ones cost O(n^3).
EKF-SLAM: Thrun, Burgard, Fox, "Probabilistic Robotics" (2005), chapter 10.

A plain EKF linearises the same landmark about ever new estimates, and so believes to have learned
the heading from sights that cannot tell it. `invariant` keeps the errors of all positions in the
frame that turns with the heading's error: the right-invariant EKF of Barrau and Bonnabel, "An EKF-
SLAM algorithm with consistency properties" (2015), in the coordinates of the plain one.
"""

from __future__ import annotations

import math

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter

from robot.geometry.se2 import exp, wrap_angle

POSE, CALIBRATION, MARKER = slice(0, 3), slice(3, 7), slice(7, 10)
FIRST_LANDMARK = 10
YAW, MARKER_YAW = 2, 9


class LandmarkFilter(ExtendedKalmanFilter):
    """Pose, calibration, one marker and any number of landmarks; `x` is (n,), `P` (n, n)."""

    def __init__(self, sigma: np.ndarray, invariant: bool = False) -> None:
        """Start at zero with standard deviations `sigma` (10,), uncorrelated."""
        super().__init__(dim_x=FIRST_LANDMARK, dim_z=2)
        self.x = np.zeros(FIRST_LANDMARK)
        self.P = np.diag(np.asarray(sigma, dtype=float) ** 2)
        self.Q = np.zeros((FIRST_LANDMARK, FIRST_LANDMARK))
        self._invariant = invariant
        self._resized()

    @property
    def count(self) -> int:
        """Number of landmarks."""
        return (self.dim_x - FIRST_LANDMARK) // 2

    @property
    def calibration(self) -> np.ndarray:
        """What the motion model must correct (4,), a view."""
        return self.x[CALIBRATION]

    def landmarks(self) -> np.ndarray:
        """Positions (m, 2), a copy."""
        return self.x[FIRST_LANDMARK:].reshape(-1, 2).copy()

    def landmark_covs(self) -> np.ndarray:
        """Covariances (m, 2, 2)."""
        i = FIRST_LANDMARK + 2 * np.arange(self.count)
        index = i[:, None] + np.arange(2)
        return self.P[index[:, :, None], index[:, None, :]]

    def predict(  # type: ignore[override]
        self,
        pose: np.ndarray,
        by_pose: np.ndarray,
        by_calibration: np.ndarray,
        noise: np.ndarray,
        calibration_noise: np.ndarray,
    ) -> None:
        """Move to `pose` (3,), with Jacobians (3, 3) and covariances `noise` (3, 3) of the pose
        and `calibration_noise` (4,) variances of the calibration's random walk.

        Equal to filterpy's dense predict with F and Q filled with the same blocks.
        """
        rows = by_pose @ self.P[POSE] + by_calibration @ self.P[CALIBRATION]
        corner = rows[:, POSE] @ by_pose.T + rows[:, CALIBRATION] @ by_calibration.T + noise
        self.P[POSE] = rows
        self.P[:, POSE] = rows.T
        self.P[POSE, POSE] = 0.5 * (corner + corner.T)
        diagonal = np.arange(CALIBRATION.start, CALIBRATION.stop)
        self.P[diagonal, diagonal] += calibration_noise
        self.x[POSE] = pose

    def innovation(
        self, columns: np.ndarray, jacobian: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """H P (m r, n) and H P H^T (m r, m r) of m measurements of r rows each.

        `columns` (m, k) are the state entries a measurement depends on, `jacobian` (m, r, k) its
        derivatives by them.
        """
        m, r, _ = jacobian.shape
        hp = (jacobian @ self.P[columns]).reshape(m * r, self.dim_x)
        blocks = hp[:, columns].transpose(1, 0, 2) @ jacobian.transpose(0, 2, 1)  # (m, m r, r)
        hph = blocks.transpose(1, 0, 2).reshape(m * r, m * r)
        return hp, 0.5 * (hph + hph.T)

    def update(  # type: ignore[override]
        self,
        columns: np.ndarray,
        jacobian: np.ndarray,
        residual: np.ndarray,
        noise: np.ndarray,
        prepared: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> None:
        """Take in m measurements at once: `residual` (m, r), `noise` (m, r, r).

        `prepared` is what `innovation` gave for the same `columns` and `jacobian`.
        Same posterior as filterpy's dense Joseph-form update, in the form P - W W^T with
        W = P H^T L^-T and L L^T = S, which keeps P symmetric to the last bit.
        """
        hp, hph = self.innovation(columns, jacobian) if prepared is None else prepared
        m, r = residual.shape
        spread = hph.copy()
        for i in range(m):
            spread[r * i : r * i + r, r * i : r * i + r] += noise[i]
        lower = np.linalg.cholesky(spread)
        solved = np.linalg.solve(lower, np.column_stack([residual.reshape(-1), hp]))
        whitened, w_t = solved[:, 0], solved[:, 1:]
        change = whitened @ w_t
        if self._invariant:
            swing = self._turn_positions(change)
            row = self.P[YAW] - w_t[:, YAW] @ w_t
            more, less = _halves(swing, row + (0.5 * row[YAW]) * swing)
            w_t = np.vstack([w_t, less])
            self.P += np.outer(more, more)
        else:
            self.x = self.x + change
        self.P -= w_t.T @ w_t
        self._wrap()

    def _turn_positions(self, change: np.ndarray) -> np.ndarray:
        """Apply a correction (n,), turning all positions together; returns their swing (n,).

        With xi = (turn, shift of each position) and J the quarter turn, a position p becomes
        exp(xi) p, where shift = change - J p turn. Its error is shift + J p turn, so that the
        covariance must follow p: P becomes (I + s e^T) P (I + e s^T), where the swing s is J times
        the way that each position went, and e picks the heading.
        """
        turn = float(change[YAW])
        index = self._positions()
        before = self.x[index]
        shift = change[index] - turn * np.stack([-before[:, 1], before[:, 0]], axis=1)
        a, b = _arc(turn)
        shifted = np.stack(
            [a * shift[:, 0] - b * shift[:, 1], b * shift[:, 0] + a * shift[:, 1]], axis=1
        )
        self.x = self.x + change
        self.x[index] = exp(0.0, 0.0, turn).apply(before) + shifted
        moved = self.x[index] - before
        swing = np.zeros(self.dim_x)
        swing[index] = np.stack([-moved[:, 1], moved[:, 0]], axis=1)
        return swing

    def _positions(self) -> np.ndarray:
        """Indices (1 + 1 + m, 2) of the entries that are x and y."""
        first = np.arange(FIRST_LANDMARK, self.dim_x, 2)
        first = np.concatenate([[POSE.start, MARKER.start], first])
        return first[:, None] + np.arange(2)

    def inflate(self, cov: np.ndarray) -> None:
        """Add `cov` (3, 3) to the pose's covariance: motion the odometry did not feel."""
        self.P[POSE, POSE] += cov

    def loosen(self, landmark: np.ndarray, sigma_m: np.ndarray) -> None:
        """Let the landmarks of the indices (p,) have moved by `sigma_m` (p,) either way."""
        first = FIRST_LANDMARK + 2 * landmark
        for index in (first, first + 1):
            self.P[index, index] += sigma_m**2

    def place_marker(
        self, marker: np.ndarray, by_pose: np.ndarray, by_seen: np.ndarray, noise: np.ndarray
    ) -> None:
        """Set the marker (3,) from a first sight, with Jacobians by the pose and the sight."""
        self.x[MARKER] = marker
        cross = by_pose @ self.P[POSE]
        corner = cross[:, POSE] @ by_pose.T + by_seen @ noise @ by_seen.T
        self.P[MARKER] = cross
        self.P[:, MARKER] = cross.T
        self.P[MARKER, MARKER] = 0.5 * (corner + corner.T)
        self._wrap()

    def add(
        self, position: np.ndarray, by_pose: np.ndarray, by_seen: np.ndarray, noise: np.ndarray
    ) -> None:
        """Append m landmarks seen from the present pose, with their full cross-covariance.

        `position` (m, 2); `by_pose` (m, 2, 3) and `by_seen` (m, 2, 2) are its derivatives by the
        pose and by the sight, whose covariance is `noise` (m, 2, 2).
        """
        n, m = self.dim_x, len(position)
        swing = by_pose.reshape(2 * m, 3)
        cross = swing @ self.P[POSE]
        corner = cross[:, POSE] @ swing.T
        own = by_seen @ noise @ by_seen.transpose(0, 2, 1)
        for i in range(m):
            corner[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] += own[i]
        grown = np.empty((n + 2 * m, n + 2 * m))
        grown[:n, :n] = self.P
        grown[n:, :n] = cross
        grown[:n, n:] = cross.T
        grown[n:, n:] = 0.5 * (corner + corner.T)
        self.P = grown
        self.x = np.concatenate([self.x, position.reshape(-1)])
        self._resized()

    def keep(self, kept: np.ndarray) -> None:
        """Marginalise all landmarks but those of the indices `kept`, which are renumbered."""
        entries = FIRST_LANDMARK + (2 * kept[:, None] + np.arange(2)).reshape(-1)
        index = np.concatenate([np.arange(FIRST_LANDMARK), entries]).astype(int)
        self.x = self.x[index]
        self.P = np.ascontiguousarray(self.P[np.ix_(index, index)])
        self._resized()

    def _wrap(self) -> None:
        self.x[YAW] = wrap_angle(float(self.x[YAW]))
        self.x[MARKER_YAW] = wrap_angle(float(self.x[MARKER_YAW]))

    def _resized(self) -> None:
        """Keep filterpy's other matrices of the state's size, so that its dense steps work."""
        self.dim_x = len(self.x)
        self.F = self._I = np.eye(self.dim_x)
        self.Q = np.zeros((self.dim_x, self.dim_x))


def _arc(turn_rad: float) -> tuple[float, float]:
    """sin(t) / t and (1 - cos(t)) / t."""
    if abs(turn_rad) < 1e-6:
        return 1.0 - turn_rad * turn_rad / 6.0, 0.5 * turn_rad
    return math.sin(turn_rad) / turn_rad, (1.0 - math.cos(turn_rad)) / turn_rad


def _halves(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """u and v with u u^T - v v^T = a b^T + b a^T, which is symmetric to the last bit."""
    size_a, size_b = float(np.linalg.norm(a)), float(np.linalg.norm(b))
    if size_a == 0.0 or size_b == 0.0:
        return np.zeros_like(a), np.zeros_like(b)
    balance = math.sqrt(size_b / size_a)
    a, b = a * (balance / math.sqrt(2.0)), b / (balance * math.sqrt(2.0))
    return a + b, a - b
