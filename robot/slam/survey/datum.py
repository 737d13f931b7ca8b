"""Whose frame a map is in: the one in which the track so far lies as it was told.

Sights tell how poses and things lie to each other, never where all of it lies; that is free to
choose, the datum of geodesy (Baarda, "S-transformations and criterion matrices", 1973; Triggs et
al., "Bundle adjustment - a modern synthesis", 1999, section 9). An EKF ties it to the first pose.
When it later learns better how that first heading was, the whole map swings with all that anybody
drew on it, and new poses no longer fit the ones told before.

So some past positions stay in the filter as waymarks, which are corrected with everything else,
and the frame follows them: it is turned and shifted so that they lie nearest to where they were
told to be.
"""

from __future__ import annotations

import math

import numpy as np

from robot.geometry.se2 import SE2
from robot.slam.ekf import POSE, LandmarkFilter
from robot.slam.relocalise import rigid_fit

_WAYMARKS = 32  # kept at most; then every other goes, and new ones come half as often
_FIRST_EVERY_S = 10.0


class Datum:
    """Chooses `told_from_filter`: what is told to others, from the filter's own frame."""

    def __init__(self) -> None:
        self.told_from_filter = SE2()
        self._told = np.zeros((0, 2))  # where each waymark was told to be
        self._every_s = _FIRST_EVERY_S
        self._next_s = -np.inf

    def due(self, t_s: float) -> bool:
        """Whether it is time for a waymark."""
        return t_s >= self._next_s

    def leave(self, ekf: LandmarkFilter, t_s: float) -> None:
        """Append the present position to the filter, as a point that is never seen."""
        place = ekf.x[POSE][None, :2]
        ekf.add(place, np.eye(2, 3)[None], np.zeros((1, 2, 2)), np.zeros((1, 2, 2)))
        self._told = np.vstack([self._told, self.told_from_filter.apply(place)])
        self._next_s = t_s + self._every_s

    def thin(self) -> np.ndarray:
        """Numbers of the waymarks that go: every other one, once they are too many."""
        if len(self._told) <= _WAYMARKS:
            return np.zeros(0, dtype=int)
        gone = np.arange(1, len(self._told), 2)
        self._told = np.delete(self._told, gone, axis=0)
        self._every_s *= 2.0
        return gone

    def follow(self, places: np.ndarray) -> None:
        """Choose the frame by the waymarks' present places (n, 2) in the filter."""
        if len(places) > 1:
            self.told_from_filter = rigid_fit(places, self._told)

    def pose(self, ekf: LandmarkFilter) -> tuple[np.ndarray, np.ndarray]:
        """Pose (3,) as told, and its covariance (3, 3) as from the first pose.

        From the waymarks it would be smaller, but how far the frame will yet move is not known.
        """
        pose = self.told_from_filter @ SE2(*ekf.x[POSE].tolist())
        turn = np.eye(3)
        turn[:2, :2] = self._turn()
        cov = turn @ ekf.head()[POSE, POSE] @ turn.T
        return np.array([pose.x_m, pose.y_m, pose.yaw_rad]), cov

    def points(self, places: np.ndarray, covs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points (n, 2) of the filter as told, and their covariances (n, 2, 2)."""
        turn = self._turn()
        return self.told_from_filter.apply(places), turn @ covs @ turn.T

    def _turn(self) -> np.ndarray:
        c, s = math.cos(self.told_from_filter.yaw_rad), math.sin(self.told_from_filter.yaw_rad)
        return np.array([[c, -s], [s, c]])
