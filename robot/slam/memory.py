"""What the filter and its map know, as plain arrays, so that another run can begin with it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from robot.slam.catalogue import Entry
from robot.slam.places import SIGNATURE_BYTES, PlacePoints

if TYPE_CHECKING:
    from robot.slam.ekf import LandmarkFilter
    from robot.slam.landmark_map import LandmarkMap

_POSE_SIGMA = (1.0, 1.0, 1.0)  # m, m, rad: nobody knows where the robot wakes up


@dataclass(frozen=True, slots=True, eq=False)
class SlamMemory:
    """A filter's state (n,) and covariance (n, n), its m landmarks and the places of the home."""

    state: np.ndarray
    cov: np.ndarray
    marker_known: bool
    kind: np.ndarray  # (m,)
    height_m: np.ndarray  # (m,), NaN unknown
    sightings: np.ndarray  # (m,)
    visits: np.ndarray  # (m,)
    along: np.ndarray  # (m, 2) mean unit line of sight, NaN unknown
    signature: np.ndarray  # (k, 32) uint8, k >= m
    signature_of: np.ndarray  # (k,) index of the landmark
    places: PlacePoints


def remember(known: LandmarkMap, places: PlacePoints) -> SlamMemory:
    """Copy what is known, of landmarks awake and asleep."""
    ekf, entries = known.whole()
    signatures = [(i, bits) for i, entry in enumerate(entries) for bits in entry.bits]
    packed = np.array([np.packbits(bits > 0) for _, bits in signatures], dtype=np.uint8)
    return SlamMemory(
        state=ekf.x.copy(),
        cov=ekf.P.copy(),
        marker_known=known.marker_known,
        kind=np.array([entry.kind for entry in entries], np.uint8),
        height_m=np.array([entry.height_m for entry in entries], float),
        sightings=np.array([entry.sightings for entry in entries], np.int32),
        visits=np.array([entry.visits for entry in entries], np.int32),
        along=np.array([entry.along for entry in entries], float).reshape(-1, 2),
        signature=packed.reshape(-1, SIGNATURE_BYTES),
        signature_of=np.array([i for i, _ in signatures], np.int32),
        places=places,
    )


def restore(memory: SlamMemory, ekf: LandmarkFilter, known: LandmarkMap) -> None:
    """Put a memory into a new filter and its map; the pose is unknown.

    The calibration is as unsure as the new filter's: a gyro's bias is another at every start.
    """
    from robot.slam.ekf import CALIBRATION  # filterpy takes a second to import

    unsure = ekf.P[CALIBRATION, CALIBRATION].copy()
    ekf.x, ekf.P = memory.state.copy(), memory.cov.copy()
    ekf.put(np.zeros(3), np.diag(_POSE_SIGMA) ** 2)
    ekf.doubt(CALIBRATION, unsure)
    bits = 2.0 * np.unpackbits(memory.signature, axis=1).astype(np.float32) - 1.0
    views: list[list[np.ndarray]] = [[] for _ in memory.kind]
    for of, row in zip(memory.signature_of.tolist(), bits, strict=True):
        views[of].append(row)
    known.marker_known = memory.marker_known
    columns = memory.kind, memory.height_m, memory.sightings, memory.visits, memory.along
    known.entries = [
        Entry(i, int(kind), float(height_m), views[i], int(sightings), int(visits), 0, 0, along)
        for i, (kind, height_m, sightings, visits, along) in enumerate(zip(*columns, strict=True))
    ]
