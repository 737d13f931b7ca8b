"""The filter: filterpy's ExtendedKalmanFilter with block-sparse steps and a state that grows.

This is the only file that knows filterpy's inside. State, in order:

    pose (x_m, y_m, yaw_rad) | calibration (4 of the motion model)
    | marker (x_m, y_m, yaw_rad) | landmarks (x_m, y_m) ...

A motion changes three rows of the covariance and a measurement reads a handful, so a predict costs
O(n) and an update O(n^2) where the dense ones cost O(n^3). A symmetric matrix is told by its upper
half: the steps write nothing else, in place, in a store with room for a few landmarks more, whose
unused rows are zero. Who reads `P` gets the lower half filled in first.
EKF-SLAM: Thrun, Burgard, Fox, "Probabilistic Robotics" (2005), chapter 10.

A plain EKF linearises the same landmark about ever new estimates, and so believes to have learned
the heading from sights that cannot tell it. An `invariant` one does not: see `turning`.
"""

from __future__ import annotations

import copy

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from scipy.linalg.blas import dsyr2, dsyrk, dtrsm, dtrsv
from scipy.linalg.lapack import dpotrf

from robot.geometry.se2 import wrap_angle
from robot.slam.turning import bend, multiply, swing

POSE, CALIBRATION, MARKER = slice(0, 3), slice(3, 7), slice(7, 10)
FIRST_LANDMARK = 10
YAW, MARKER_YAW = 2, 9
_MOVED_BY = slice(0, 7)  # what a motion reads: pose and calibration
_HEAD = slice(0, FIRST_LANDMARK)
_BELOW = np.tri(FIRST_LANDMARK, k=-1, dtype=bool)
_SPARE = 32  # entries of room for new landmarks


class LandmarkFilter(ExtendedKalmanFilter):
    """Pose, calibration, one marker and any number of landmarks; `x` is (n,), `P` (n, n)."""

    dim_x: int
    _stale: bool

    def __init__(self, sigma: np.ndarray, invariant: bool = False) -> None:
        """Start at zero with standard deviations `sigma` (10,), uncorrelated."""
        super().__init__(dim_x=FIRST_LANDMARK, dim_z=2)
        self.x = np.zeros(FIRST_LANDMARK)
        self.P = np.diag(np.asarray(sigma, dtype=float) ** 2)
        self._invariant = invariant

    @property
    def P(self) -> np.ndarray:
        """Covariance (n, n), a view; what is written into it must be symmetric."""
        n = self.dim_x
        if self._stale:
            upper = np.triu(self._store[:n, :n], 1)
            diagonal = self._store.diagonal()[:n].copy()
            np.add(upper, upper.T, out=self._store[:n, :n])
            self._store[np.arange(n), np.arange(n)] = diagonal
            self._stale = False
        return self._store[:n, :n]

    @P.setter
    def P(self, cov: np.ndarray) -> None:
        self._store = _roomy(cov, len(cov) + _SPARE)
        self._stale = False
        self.dim_x = len(cov)

    @property
    def count(self) -> int:
        """Number of landmarks."""
        return (self.dim_x - FIRST_LANDMARK) // 2

    @property
    def calibration(self) -> np.ndarray:
        """What the motion model must correct (4,), a view."""
        return self.x[CALIBRATION]

    def head(self) -> np.ndarray:
        """Covariance (10, 10) of pose, calibration and marker, a view; cheaper than P's corner."""
        corner = self._store[_HEAD, _HEAD]
        np.copyto(corner, corner.T, where=_BELOW)
        return corner

    def landmarks(self) -> np.ndarray:
        """Positions (m, 2), a copy."""
        return self.x[FIRST_LANDMARK:].reshape(-1, 2).copy()

    def landmark_covs(self) -> np.ndarray:
        """Covariances (m, 2, 2)."""
        first = np.arange(FIRST_LANDMARK, self.dim_x, 2)
        covs = np.empty((len(first), 2, 2))
        covs[:, 0, 0], covs[:, 1, 1] = self._store[first, first], self._store[first + 1, first + 1]
        covs[:, 0, 1] = covs[:, 1, 0] = self._store[first, first + 1]
        return covs

    def pose_covs(self) -> np.ndarray:
        """Covariances (m, 3, 2) of the pose with each landmark."""
        rows = self._store[POSE, FIRST_LANDMARK : self.dim_x]
        return rows.reshape(3, -1, 2).transpose(1, 0, 2)

    def clone(self) -> LandmarkFilter:
        """The same filter with a state of its own."""
        twin = copy.copy(self)
        twin.x, twin._store = self.x.copy(), self._store.copy()
        return twin

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
        head = self.head()
        motion = np.concatenate([by_pose, by_calibration], axis=1)
        rows = motion @ self._store[_MOVED_BY]
        self._store[POSE] = rows
        head[POSE, POSE] = rows[:, _MOVED_BY] @ motion.T + noise
        np.einsum("ii->i", head[CALIBRATION, CALIBRATION])[:] += calibration_noise
        self.x[POSE] = pose
        self._stale = True

    def innovation(
        self, columns: np.ndarray, jacobian: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """H P (m r, n or more) and H P H^T (m r, m r) of m measurements of r rows each.

        `columns` (m, k) are the state entries a measurement depends on, `jacobian` (m, r, k) its
        derivatives by them. H P has zeros beyond the state's size.
        """
        m, r, _ = jacobian.shape
        hp = (jacobian @ self._rows(columns)).reshape(m * r, len(self._store))
        blocks = hp[:, columns].transpose(1, 0, 2) @ jacobian.transpose(0, 2, 1)  # (m, m r, r)
        hph = blocks.transpose(1, 0, 2).reshape(m * r, m * r)
        return hp, 0.5 * (hph + hph.T)

    def _rows(self, columns: np.ndarray) -> np.ndarray:
        """Rows (m, k, width) of the whole covariance for the entries `columns` (m, k)."""
        self.head()
        rows: np.ndarray = self._store[columns]
        width = len(self._store)
        flat = rows.reshape(-1, width)
        for i, entry in enumerate(columns.reshape(-1).tolist()):
            if entry >= FIRST_LANDMARK:  # of the others the head has the rest
                flat[i, :entry] = self._store[:entry, entry]
        return rows

    def update(  # type: ignore[override]
        self,
        columns: np.ndarray,
        jacobian: np.ndarray,
        residual: np.ndarray,
        noise: np.ndarray,
        prepared: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> None:
        """Take in m measurements at once: `residual` (m, r), `noise` (m, r, r).

        `prepared` is what `innovation` gave for the same `columns` and `jacobian`; it is used up.
        Same posterior as filterpy's dense Joseph-form update, in the form P - W^T W with
        W = L^-1 H P and L L^T = S. Raises LinAlgError where S is not positive definite.
        """
        hp, spread = self.innovation(columns, jacobian) if prepared is None else prepared
        m, r = residual.shape
        np.einsum("iaib->iab", spread.reshape(m, r, m, r))[:] += noise
        lower, failed = dpotrf(spread, lower=1)
        if failed:
            raise np.linalg.LinAlgError("the innovation's covariance is not positive definite")
        # BLAS counts columns first: to it every matrix here is transposed, and the upper half lower
        white = dtrsm(1.0, lower, hp.T, side=1, lower=1, trans_a=1, overwrite_b=1)
        change = white @ dtrsv(lower, residual.reshape(-1), lower=1)
        dsyrk(-1.0, white, beta=1.0, c=self._store.T, lower=1, overwrite_c=1)
        if self._invariant:
            self._turn_positions(change)
        self.x = self.x + change[: self.dim_x]
        self._wrap()
        self._stale = True

    def _turn_positions(self, change: np.ndarray) -> None:
        """Make the correction (n or more,) turn all positions together, and P with them."""
        self._bend(change)
        swung = swing(change, _positions(change))
        yaw = self.head()[YAW, YAW]
        row = self._store[YAW] + (0.5 * yaw) * swung
        dsyr2(1.0, swung, row, a=self._store.T, lower=1, overwrite_a=1)

    def put(self, pose: np.ndarray, cov: np.ndarray) -> None:
        """Put the robot to `pose` (3,) with covariance `cov` (3, 3), known from elsewhere."""
        self.x[POSE] = pose
        self.doubt(POSE, cov)

    def doubt(self, part: slice, cov: np.ndarray) -> None:
        """Know a part of the state to `cov` only, and apart from all else; its values stay."""
        self.P[part] = 0.0
        self.P[:, part] = 0.0
        self.P[part, part] = cov

    def bend(self, turn_rad: float) -> tuple[complex, complex]:
        """What a position's change is multiplied by when the heading's is `turn_rad`; its slope."""
        return bend(turn_rad) if self._invariant else (1.0 + 0j, 0j)

    def _bend(self, change: np.ndarray) -> None:
        """Make a change (n or more,) that the gain gives the way that each entry goes."""
        multiply(change, self.bend(float(change[YAW]))[0], _positions(change))

    def changed(self, change: np.ndarray) -> np.ndarray:
        """The state (n,) after a change (n,) that the gain gives; this one stays as it is."""
        gone = change.copy()
        self._bend(gone)
        return self.x + gone

    def inflate(self, cov: np.ndarray) -> None:
        """Add `cov` (3, 3) to the pose's covariance: motion the odometry did not feel."""
        self._store[POSE, POSE] += cov

    def loosen(self, landmark: np.ndarray, sigma_m: np.ndarray) -> None:
        """Let the landmarks of the indices (p,) have moved by `sigma_m` (p,) either way."""
        first = FIRST_LANDMARK + 2 * landmark
        for index in (first, first + 1):
            self._store[index, index] += sigma_m**2

    def place_marker(
        self, marker: np.ndarray, by_pose: np.ndarray, by_seen: np.ndarray, noise: np.ndarray
    ) -> None:
        """Set the marker (3,) from a first sight, with Jacobians by the pose and the sight."""
        self.x[MARKER] = marker
        cov = self.P
        cross = by_pose @ cov[POSE]
        corner = cross[:, POSE] @ by_pose.T + by_seen @ noise @ by_seen.T
        cov[MARKER] = cross
        cov[:, MARKER] = cross.T
        cov[MARKER, MARKER] = 0.5 * (corner + corner.T)
        self._wrap()

    def add(
        self, position: np.ndarray, by_pose: np.ndarray, by_seen: np.ndarray, noise: np.ndarray
    ) -> None:
        """Append m landmarks seen from the present pose, with their full cross-covariance.

        `position` (m, 2); `by_pose` (m, 2, 3) and `by_seen` (m, 2, 2) are its derivatives by the
        pose and by the sight, whose covariance is `noise` (m, 2, 2).
        """
        m = len(position)
        self.head()
        swing = by_pose.reshape(2 * m, 3)
        cross = swing @ self._store[POSE, : self.dim_x]
        corner = cross[:, POSE] @ swing.T
        own = by_seen @ noise @ by_seen.transpose(0, 2, 1)
        np.einsum("iaib->iab", corner.reshape(m, 2, m, 2))[:] += own
        self.append(position, cross, corner)

    def append(self, position: np.ndarray, cross: np.ndarray, corner: np.ndarray) -> None:
        """Append m landmarks at `position` (m, 2) with covariance `corner` (2 m, 2 m), and `cross`
        (2 m, n) with the state so far."""
        n, end = self.dim_x, self.dim_x + 2 * len(position)
        if end > len(self._store):
            self._store = _roomy(self._store, end + _SPARE)
        self._store[:n, n:end] = cross.T
        self._store[n:end, n:end] = 0.5 * (corner + corner.T)
        self.x = np.concatenate([self.x, position.reshape(-1)])
        self.dim_x, self._stale = end, True

    def keep(self, kept: np.ndarray) -> None:
        """Marginalise all landmarks but those of the indices `kept`, which are renumbered."""
        entries = FIRST_LANDMARK + (2 * kept[:, None] + np.arange(2)).reshape(-1)
        index = np.concatenate([np.arange(FIRST_LANDMARK), entries]).astype(int)
        self.x, self.P = self.x[index], self.P[np.ix_(index, index)]

    def prepare_dense(self) -> None:
        """Bring filterpy's other matrices to the state's size: its own steps need them."""
        self.F = self._I = np.eye(self.dim_x)
        self.Q = np.zeros((self.dim_x, self.dim_x))

    def _wrap(self) -> None:
        self.x[YAW] = wrap_angle(float(self.x[YAW]))
        self.x[MARKER_YAW] = wrap_angle(float(self.x[MARKER_YAW]))


def _positions(entries: np.ndarray) -> tuple[slice, slice, slice]:
    """Where pairs of x and y stand among the entries (n,) of a state."""
    return slice(0, 2), slice(7, 9), slice(FIRST_LANDMARK, len(entries))


def _roomy(cov: np.ndarray, size: int) -> np.ndarray:
    """`cov` in the corner of a matrix (size, size) of zeros."""
    store = np.zeros((size, size))
    store[: len(cov), : len(cov)] = cov
    return store
