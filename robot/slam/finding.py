"""Does the robot still know where it is? And if not, where is it?

While all is well, every frame adds to the places of the home. Now and then the points around the
robot are compared with all places, and often when no landmark that has long been known was seen for
some seconds (unknown ground, or somebody carried the robot). If they speak for another pose, the
robot is lost: it believes nothing but odometry until a pose is certain.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

import numpy as np

from robot.config import SlamConfig
from robot.geometry.se2 import SE2, wrap_angle
from robot.messages import Seen
from robot.slam.continuity import Continuity
from robot.slam.places import PlaceMap, PlacePoints, Tracks
from robot.slam.relocalise import Glimpse, Relocaliser

FAMILIAR_NS = 10_000_000_000  # a landmark known for so long was not born of an error just made
_FAMILIAR_COUNT = 3
_DOUBT_NS = 1_500_000_000  # without a familiar landmark for so long, the pose is checked
_QUARANTINE_NS = 30_000_000_000
_DOUBTING_EVERY_NS, _CALM_EVERY_NS = 500_000_000, 2_500_000_000
_APART_M, _APART_RAD = 0.4, 0.35  # drift stays below: found farther away, the robot was carried
_APART_SIGMAS = 4.0
_LEAP_M = 1.0  # and so far it never drifts
_MAY_FIT = 0.5  # so much of what stands around: it may be the pose
FOUND_COV = np.diag([0.08, 0.08, 0.03]) ** 2

Fits = Callable[[SE2], float]  # share of what stands around that fits a pose; NaN: seen too little


class SelfFinder:
    """Keeps the places of the home and judges the pose by them."""

    def __init__(self, config: SlamConfig, places: PlacePoints | None = None) -> None:
        self._config = config
        self.places = PlaceMap(config.max_places, *(() if places is None else (places,)))
        self._at_home = places is not None
        self._tracks = Tracks()
        self._waiting: deque[tuple[int, PlacePoints]] = deque()
        self._relocaliser = Relocaliser()
        self._local_from_base = SE2()
        self.lost = False
        self._sure_ns: int | None = None  # when familiar landmarks last spoke for the pose
        self.placed_ns = 0  # when places last did
        self._continuity = Continuity()
        self._broken_ns = 0  # when nothing was followed on: what was seen before stands apart

    def moved(self, previous_from_current: SE2) -> None:
        """Carry the local frame along with the odometry."""
        self._local_from_base = self._local_from_base @ previous_from_current
        self._continuity.moved(previous_from_current)

    def lose(self) -> None:
        """The robot does not know where it is any more; what it saw before is of no use."""
        self.lost = True
        self._drop_new()
        self._relocaliser = Relocaliser()

    def found(self, t_ns: int) -> None:
        """The robot knows where it is."""
        self.lost = False
        self._sure_ns = self.placed_ns = t_ns
        self._continuity = Continuity()
        self._drop_new()

    @property
    def unconfirmed(self) -> bool:
        """Whether, at home, nothing familiar was seen since all that was followed ended."""
        return self._at_home and self._broken_ns > (self._sure_ns or 0)

    def search(self, seen: Seen, fits: Fits | None = None) -> SE2 | None:
        """While lost: world_from_base at the frame's time, once it is certain."""
        glimpse = self._look(seen, _DOUBTING_EVERY_NS)
        if glimpse is None or not glimpse.confirmed:
            return None
        pose = glimpse.map_from_local @ self._local_from_base
        return pose if fits is None or fits(pose) >= _MAY_FIT else None

    def follow(self, seen: Seen) -> None:
        """While not lost, every frame: be lost where it shows another place than the last one."""
        change = self._continuity.follow(seen)
        if change != "none":
            self._broken_ns = seen.t_ns
        if change == "carried":
            self.lose()

    def judge(
        self, seen: Seen, familiar: int, pose: SE2, cov: np.ndarray, fits: Fits | None = None
    ) -> None:
        """While not lost: remember places, or find that the pose is wrong and be lost.

        `familiar` landmarks were recognised in the frame at `pose` with covariance (3, 3).
        """
        if familiar >= _FAMILIAR_COUNT or self._sure_ns is None:
            self._sure_ns = seen.t_ns
        self._learn(seen, pose)
        in_doubt = seen.t_ns - self._sure_ns > _DOUBT_NS
        every_ns = _DOUBTING_EVERY_NS if in_doubt else _CALM_EVERY_NS
        since_ns = self._sure_ns if in_doubt else seen.t_ns - _CALM_EVERY_NS
        glimpse = self._look(seen, every_ns, max(since_ns, self._broken_ns))
        if glimpse is None:
            return
        found = glimpse.map_from_local @ self._local_from_base
        if not self._contradicts(found, pose, cov):
            self._sure_ns = self.placed_ns = seen.t_ns
        elif found.distance_m(pose) > _LEAP_M and not self._at_home:
            return  # in a home that is still new, rooms that look alike are likelier than a carry
        elif fits is not None and fits(pose) > fits(found):
            return
        elif in_doubt or glimpse.confirmed:  # one look is no match for landmarks long known
            self.lost = True  # the relocaliser goes on with what it has seen
            self._drop_new()

    def _learn(self, seen: Seen, pose: SE2) -> None:
        """New places wait, so that an error of the pose is not confirmed by what it made."""
        self._tracks.add(seen.t_ns, seen.landmarks, pose)
        ended = self._tracks.take_ended(seen.t_ns, self._config.place_sightings)
        if len(ended):
            self._waiting.append((seen.t_ns, ended))
        while self._waiting and seen.t_ns - self._waiting[0][0] > _QUARANTINE_NS:
            self.places.add(self._waiting.popleft()[1])

    def _drop_new(self) -> None:
        self._tracks.clear()
        self._waiting.clear()

    def _look(self, seen: Seen, every_ns: int, since_ns: int = 0) -> Glimpse | None:
        places = self.places.points
        where = self._local_from_base
        return self._relocaliser.look(seen.t_ns, seen.landmarks, where, places, every_ns, since_ns)

    @staticmethod
    def _contradicts(found: SE2, pose: SE2, cov: np.ndarray) -> bool:
        sigma_m = math.sqrt(max(0.0, float(np.linalg.eigvalsh(cov[:2, :2])[-1])))
        sigma_rad = math.sqrt(max(0.0, float(cov[2, 2])))
        away_m = math.hypot(found.x_m - pose.x_m, found.y_m - pose.y_m)
        away_rad = abs(wrap_angle(found.yaw_rad - pose.yaw_rad))
        far = away_m > max(_APART_M, _APART_SIGMAS * sigma_m)
        return far or away_rad > max(_APART_RAD, _APART_SIGMAS * sigma_rad)
