"""What places look like: far more points than the filter can hold, kept to be found again by.

Every followed point that was seen often enough leaves one place point: where it stood, how high,
and its signature. The filter's landmarks are few and chosen for tracking; a robot that woke up
somewhere needs thousands of points to recognise a room.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from robot.geometry.se2 import SE2
from robot.messages import Landmark

SIGNATURE_BYTES = 32
KINDS = ("point", "edge")
_ENDED_NS = 1_000_000_000  # a track unseen for so long will not come back
_CELL_M = 0.1
_SAME_HEIGHT_M = 0.04
_SAME_BITS = 40  # of 256: nearer than this, two points of one cell are the same


@dataclass(frozen=True, slots=True, eq=False)
class PlacePoints:
    """n points: `xy_m` (n, 2), `height_m` (n,), `signature` uint8 (n, 32), `kind` and `sightings`
    (n,)."""

    xy_m: np.ndarray
    height_m: np.ndarray
    signature: np.ndarray
    kind: np.ndarray
    sightings: np.ndarray

    def __len__(self) -> int:
        return len(self.height_m)

    def select(self, kept: np.ndarray) -> PlacePoints:
        """Only the points of the mask or the indices `kept`."""
        return PlacePoints(
            self.xy_m[kept],
            self.height_m[kept],
            self.signature[kept],
            self.kind[kept],
            self.sightings[kept],
        )

    def joined(self, other: PlacePoints) -> PlacePoints:
        """These points, then the others."""
        return PlacePoints(
            np.concatenate([self.xy_m, other.xy_m]),
            np.concatenate([self.height_m, other.height_m]),
            np.concatenate([self.signature, other.signature]),
            np.concatenate([self.kind, other.kind]),
            np.concatenate([self.sightings, other.sightings]),
        )


NO_PLACES = PlacePoints(
    np.zeros((0, 2)),
    np.zeros(0),
    np.zeros((0, SIGNATURE_BYTES), np.uint8),
    np.zeros(0, np.uint8),
    np.zeros(0, np.int32),
)


@dataclass(slots=True, eq=False)
class _Track:
    """Weighted sums over the sightings of one followed point."""

    kind: int
    signature: bytes
    weight: float = 0.0
    x: float = 0.0
    y: float = 0.0
    height: float = 0.0
    sightings: int = 0
    last_ns: int = 0


class Tracks:
    """Averages followed points in one frame that does not jump while they are followed."""

    def __init__(self) -> None:
        self._tracks: dict[int, _Track] = {}

    def add(self, t_ns: int, landmarks: Iterable[Landmark], frame_from_base: SE2) -> None:
        """Take in the landmarks of one frame, weighted by their variance."""
        c, s = math.cos(frame_from_base.yaw_rad), math.sin(frame_from_base.yaw_rad)
        for seen in landmarks:
            if seen.track_id < 0 or seen.kind not in KINDS or not math.isfinite(seen.height_m):
                continue
            if len(seen.signature) != SIGNATURE_BYTES:
                continue
            track = self._tracks.get(seen.track_id)
            if track is None:
                track = _Track(KINDS.index(seen.kind), seen.signature)
                self._tracks[seen.track_id] = track
            ahead = seen.range_m * math.cos(seen.bearing_rad)
            aside = seen.range_m * math.sin(seen.bearing_rad)
            cov = seen.cov
            weight = 1.0 / (float(cov[0, 0]) + seen.range_m**2 * float(cov[1, 1]))
            track.weight += weight
            track.x += weight * (frame_from_base.x_m + c * ahead - s * aside)
            track.y += weight * (frame_from_base.y_m + s * ahead + c * aside)
            track.height += seen.height_m
            track.sightings += 1
            track.last_ns = t_ns
            if track.sightings & (track.sightings - 1) == 0:
                track.signature = seen.signature  # of the 1st, 2nd, 4th ...: from the middle

    def take_ended(self, t_ns: int, min_sightings: int) -> PlacePoints:
        """Points of the tracks that are no longer followed; they are forgotten here."""
        ended = [i for i, track in self._tracks.items() if t_ns - track.last_ns > _ENDED_NS]
        return _points([self._tracks.pop(i) for i in ended], min_sightings)

    def points(self, min_sightings: int) -> PlacePoints:
        """Points of all tracks, as far as they are known."""
        return _points(list(self._tracks.values()), min_sightings)

    def forget(self, before_ns: int) -> None:
        """Drop the tracks last seen before then."""
        self._tracks = {i: t for i, t in self._tracks.items() if t.last_ns >= before_ns}

    def clear(self) -> None:
        """Forget everything: the frame is no longer the same."""
        self._tracks.clear()


def _points(tracks: list[_Track], min_sightings: int) -> PlacePoints:
    tracks = [track for track in tracks if track.sightings >= min_sightings]
    if not tracks:
        return NO_PLACES
    return PlacePoints(
        np.array([(t.x / t.weight, t.y / t.weight) for t in tracks]),
        np.array([t.height / t.sightings for t in tracks]),
        np.frombuffer(b"".join(t.signature for t in tracks), np.uint8).reshape(-1, SIGNATURE_BYTES),
        np.array([t.kind for t in tracks], np.uint8),
        np.array([t.sightings for t in tracks], np.int32),
    )


class PlaceMap:
    """All place points of the home, one of each kind and look in a spot, bounded in number."""

    def __init__(self, max_points: int, points: PlacePoints = NO_PLACES) -> None:
        self._max_points = max_points
        self.points = points
        self._cells: dict[tuple[int, int], list[int]] = {}
        self._index_from(0)

    def add(self, new: PlacePoints) -> None:
        """Remember what is not known yet; beyond the bound the least seen points go."""
        first = len(self.points)
        kept = [i for i in range(len(new)) if not self._known(new, i)]
        if not kept:
            return
        self.points = self.points.joined(new.select(np.array(kept)))
        self._index_from(first)
        if len(self.points) > self._max_points:
            best = np.argsort(-self.points.sightings, kind="stable")
            self.points = self.points.select(np.sort(best[: self._max_points * 9 // 10]))
            self._cells.clear()
            self._index_from(0)

    def _index_from(self, first: int) -> None:
        for i in range(first, len(self.points)):
            self._cells.setdefault(_cell(self.points.xy_m[i]), []).append(i)

    def _known(self, new: PlacePoints, i: int) -> bool:
        ix, iy = _cell(new.xy_m[i])
        near = [
            j
            for dx in (-1, 0, 1)
            for dy in (-1, 0, 1)
            for j in self._cells.get((ix + dx, iy + dy), ())
        ]
        if not near:
            return False
        old = self.points
        same = np.abs(old.height_m[near] - new.height_m[i]) < _SAME_HEIGHT_M
        same &= np.hypot(*(old.xy_m[near] - new.xy_m[i]).T) < _CELL_M
        same &= old.kind[near] == new.kind[i]
        differ = np.bitwise_count(old.signature[near] ^ new.signature[i]).sum(axis=1)
        return bool((same & (differ < _SAME_BITS)).any())


def _cell(xy_m: np.ndarray) -> tuple[int, int]:
    return math.floor(float(xy_m[0]) / _CELL_M), math.floor(float(xy_m[1]) / _CELL_M)
