"""Where am I, without a guess: points around the robot against all places of the home.

Signatures alone pair a point with its likeliest places, most of them wrong. Every two pairs whose
points are as far apart here as there give one pose; the right pose is the one that many of them
agree on (a Hough vote over SE(2), refined by the rigid fit of Umeyama, PAMI 1991). One good vote is
not believed yet: it must be far better than any other pose, and a second look from a turned head
must confirm it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np

from robot.geometry.se2 import SE2, wrap_angle
from robot.messages import Landmark
from robot.slam.places import PlacePoints, Tracks
from robot.slam.sensor import wrap

_CHOICES = 3  # likeliest places tried for each point
_MAX_HAMMING = 60  # of 256
_HEIGHT_M = 0.06
_LEVER_M = 0.3  # nearer to each other, two points tell no direction
_STRETCH_M = 0.12  # by which the distance of two points may differ
_BIN_M, _BIN_RAD = 0.25, 0.2
_VOTES = 12  # best bins that are looked at more closely
_LOCAL_POINTS = 80  # of the local points, those seen most often
_INLIER_M = (0.2, 0.15, 0.1, 0.1)  # narrowing
_OTHER_M, _OTHER_RAD = 0.5, 0.3  # farther away, a pose is another hypothesis

_MEMORY_NS = 8_000_000_000  # odometry alone is right for so long
_LOCAL_SIGHTINGS = 3
_MIN_INLIERS = 12
_SHARE = 0.2  # of the points in view must be found in the map
_RIVAL = 0.5
_AGREE_M, _AGREE_RAD = 0.15, 0.08
_MOVED_M, _TURNED_RAD = 0.3, 0.3  # a look from so far away is another look


@dataclass(frozen=True, slots=True)
class Fix:
    """A pose found: `map_from_local`, the points that fit and those that fit the next best pose."""

    map_from_local: SE2
    inliers: int
    runner_up: int
    points: int  # in view
    spread_m: float  # root mean square distance of the fitting points from their middle

    def near(self, other: Fix, reach_m: float, reach_rad: float) -> bool:
        """Whether both say about the same."""
        away = self.map_from_local.inverse() @ other.map_from_local
        return math.hypot(away.x_m, away.y_m) < reach_m and abs(away.yaw_rad) < reach_rad


def find_pose(local: PlacePoints, places: PlacePoints) -> Fix | None:
    """The pose of the frame of `local` in the map of `places`; None where nothing fits."""
    if len(local) > _LOCAL_POINTS:
        local = local.select(np.argsort(-local.sightings, kind="stable")[:_LOCAL_POINTS])
    here, there = _pairs(local, places)
    if len(here) < 3:
        return None
    near, far = local.xy_m[here], places.xy_m[there]
    fits: list[tuple[SE2, np.ndarray]] = []
    for pose in _votes(near, far, here, there):
        if all(_apart(pose, known) for known, _ in fits):  # else it would lead to the same
            fit = _refine(pose, near, far, here, there)
            fits += [] if fit is None else [fit]
    if not fits:
        return None
    best, used = max(fits, key=lambda fit: len(fit[1]))
    others = [len(u) for pose, u in fits if _apart(best, pose)]
    spread_m = float(np.sqrt(near[used].var(axis=0).sum()))
    return Fix(best, len(used), max(others, default=0), len(local), spread_m)


def _pairs(local: PlacePoints, places: PlacePoints) -> tuple[np.ndarray, np.ndarray]:
    """Indices (p,) of points here and the places that look like them."""
    if len(local) == 0 or len(places) < _CHOICES:
        return np.zeros(0, int), np.zeros(0, int)
    alike = np.abs(local.height_m[:, None] - places.height_m[None]) < _HEIGHT_M
    alike &= local.kind[:, None] == places.kind[None]
    differ, index = cv2.batchDistance(
        local.signature, places.signature, cv2.CV_32S, normType=cv2.NORM_HAMMING, K=_CHOICES,
        mask=alike.astype(np.uint8),
    )  # fmt: skip
    here, choice = np.nonzero((differ <= _MAX_HAMMING) & (index >= 0))
    return here, index[here, choice]


def _votes(near: np.ndarray, far: np.ndarray, here: np.ndarray, there: np.ndarray) -> list[SE2]:
    """Poses on which the most couples of pairs agree."""
    i, j = np.triu_indices(len(here), 1)
    a, b = near[j] - near[i], far[j] - far[i]
    length_a, length_b = np.hypot(*a.T), np.hypot(*b.T)
    use = (here[i] != here[j]) & (there[i] != there[j])
    use &= (length_a > _LEVER_M) & (np.abs(length_a - length_b) < _STRETCH_M)
    i, j, a, b = i[use], j[use], a[use], b[use]
    yaw = wrap(np.arctan2(b[:, 1], b[:, 0]) - np.arctan2(a[:, 1], a[:, 0]))
    c, s = np.cos(yaw), np.sin(yaw)
    middle, aim = 0.5 * (near[i] + near[j]), 0.5 * (far[i] + far[j])
    x = aim[:, 0] - (c * middle[:, 0] - s * middle[:, 1])
    y = aim[:, 1] - (s * middle[:, 0] + c * middle[:, 1])
    poses = np.stack([x, y, yaw], axis=1)
    cells = np.rint(poses / (_BIN_M, _BIN_M, _BIN_RAD)).astype(int)
    if not len(cells):
        return []
    _, bin_of, count = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    bin_of = bin_of.reshape(-1)
    best = np.argsort(-count, kind="stable")[:_VOTES]
    return [
        SE2(*np.median(poses[bin_of == k], axis=0).tolist()) for k in best.tolist() if count[k] > 1
    ]


def _refine(
    pose: SE2, near: np.ndarray, far: np.ndarray, here: np.ndarray, there: np.ndarray
) -> tuple[SE2, np.ndarray] | None:
    """The rigid fit to the pairs that agree with `pose`, and their indices; None below three."""
    used = np.zeros(0, int)
    for inlier_m in _INLIER_M:
        away_m = np.hypot(*(far - pose.apply(near)).T)
        order = np.argsort(away_m, kind="stable")
        order = order[: int(np.searchsorted(away_m[order], inlier_m))]
        order = order[np.sort(np.unique(here[order], return_index=True)[1])]
        used = order[np.sort(np.unique(there[order], return_index=True)[1])]
        if len(used) < 3:
            return None
        pose = rigid_fit(near[used], far[used])
    return pose, used


def rigid_fit(near: np.ndarray, far: np.ndarray) -> SE2:
    """The motion that carries points (n, 2) onto others with the least squares (Umeyama 1991)."""
    middle, aim = near.mean(axis=0), far.mean(axis=0)
    h = (near - middle).T @ (far - aim)
    yaw = math.atan2(h[0, 1] - h[1, 0], h[0, 0] + h[1, 1])
    turned = SE2(0.0, 0.0, yaw).apply(middle[None])[0]
    return SE2(float(aim[0] - turned[0]), float(aim[1] - turned[1]), yaw)


def _apart(one: SE2, other: SE2) -> bool:
    away_m = math.hypot(one.x_m - other.x_m, one.y_m - other.y_m)
    return away_m > _OTHER_M or abs(wrap_angle(one.yaw_rad - other.yaw_rad)) > _OTHER_RAD


@dataclass(frozen=True, slots=True)
class _Look:
    """A vote, and where the robot stood in its local frame when it looked."""

    t_ns: int
    local_from_base: SE2
    fix: Fix

    def agrees(self, earlier: _Look) -> bool:
        recent = self.t_ns - earlier.t_ns <= _MEMORY_NS
        return recent and self.fix.near(earlier.fix, _AGREE_M, _AGREE_RAD)

    def shows_more_than(self, earlier: _Look) -> bool:
        """Whether the robot has turned or moved since: the same points would only repeat a vote."""
        moved = earlier.local_from_base.inverse() @ self.local_from_base
        return math.hypot(moved.x_m, moved.y_m) > _MOVED_M or abs(moved.yaw_rad) > _TURNED_RAD


@dataclass(frozen=True, slots=True)
class Glimpse:
    """A good vote for a pose; `confirmed` by an earlier one from another look."""

    map_from_local: SE2
    confirmed: bool


class Relocaliser:
    """Looks for the robot in a map. Its local frame is carried along by odometry alone."""

    def __init__(self) -> None:
        self._tracks = Tracks()
        self._tried_ns: int | None = None
        self._earlier: _Look | None = None

    def look(
        self,
        t_ns: int,
        landmarks: Iterable[Landmark],
        local_from_base: SE2,
        places: PlacePoints,
        every_ns: int,
        since_ns: int = 0,
    ) -> Glimpse | None:
        """Take in a frame; every `every_ns` compare what was seen lately with `places`.

        What was last seen before `since_ns` does not count.
        """
        self._tracks.add(t_ns, landmarks, local_from_base)
        if self._tried_ns is not None and t_ns - self._tried_ns < every_ns:
            return None
        self._tried_ns = t_ns
        self._tracks.forget(max(t_ns - _MEMORY_NS, since_ns))
        fix = find_pose(self._tracks.points(_LOCAL_SIGHTINGS), places)
        return None if fix is None else self._weigh(_Look(t_ns, local_from_base, fix))

    def _weigh(self, look: _Look) -> Glimpse | None:
        fix = look.fix
        good = fix.inliers >= max(_MIN_INLIERS, _SHARE * fix.points)
        good &= fix.runner_up <= _RIVAL * fix.inliers and fix.spread_m > _LEVER_M
        if not good:
            return None
        first = self._earlier
        agrees = first is not None and look.agrees(first)
        confirmed = first is not None and agrees and look.shows_more_than(first)
        if confirmed or not agrees:
            self._earlier = look
        return Glimpse(fix.map_from_local, confirmed)
