"""One thing mapped twice becomes one landmark again.

A landmark that was not recognised is mapped anew. Such doubles were never seen together: the one
was born after the other was last seen. Where place, height and signature agree as well, the filter
is told that both stand in the same place, which also closes the loop between them.
"""

from __future__ import annotations

import numpy as np

from robot.config import SlamConfig
from robot.slam.catalogue import BITS, Catalogue, Entry
from robot.slam.ekf import FIRST_LANDMARK, LandmarkFilter

_NEAR_M = 0.1
_RECENT_NS = 5_000_000_000  # seen since then: the others were compared before
_CHI2 = 9.2  # 99 % of two degrees of freedom
_SURE_SIGHTINGS = 10  # of the younger one, before it is believed


def merge_doubles(ekf: LandmarkFilter, catalogue: Catalogue, config: SlamConfig) -> np.ndarray:
    """Merge what was mapped twice; returns the mask (n,) of those that are to be dropped."""
    entries = catalogue.entries
    gone = np.zeros(len(entries), dtype=bool)
    if not entries:
        return gone
    places = ekf.landmarks()
    born = np.array([entry.born_ns for entry in entries])
    last = np.array([entry.last_seen_ns for entry in entries])
    sure = np.array([entry.sightings >= _SURE_SIGHTINGS for entry in entries], dtype=bool)
    news = np.flatnonzero(sure & (last > last.max() - _RECENT_NS))
    away_m = np.hypot(*(places[:, None] - places[None, news]).transpose(2, 0, 1))
    older, younger = np.nonzero((away_m < _NEAR_M) & (last[:, None] < born[None, news]))
    for i, j in zip(older.tolist(), news[younger].tolist(), strict=True):
        if gone[i] or gone[j] or not _alike(entries[i], entries[j], config):
            continue
        if _join(ekf, i, j, config.view_sigma_m):
            catalogue.join(entries[i], entries[j])
            gone[j] = True
    return gone


def _alike(a: Entry, b: Entry, config: SlamConfig) -> bool:
    if a.kind != b.kind or b.anchor or abs(a.height_m - b.height_m) > config.height_gate_m:
        return False
    if a.along @ b.along < 0.0:  # the two faces of one wall
        return False
    common = np.array(a.bits) @ np.array(b.bits).T
    return bool(0.5 * (BITS - common.max()) <= 0.5 * config.max_hamming)


def _join(ekf: LandmarkFilter, i: int, j: int, sigma_m: float) -> bool:
    """Tell the filter that two landmarks are one, unless their distance contradicts it."""
    first = FIRST_LANDMARK + 2 * np.array([i, j])
    columns = np.array([[first[0], first[0] + 1, first[1], first[1] + 1]])
    jacobian = np.hstack([np.eye(2), -np.eye(2)])[None]
    noise = max(sigma_m, 1e-3) ** 2 * np.eye(2)[None]
    away = ekf.x[columns[:, 2:]] - ekf.x[columns[:, :2]]
    prepared = ekf.innovation(columns, jacobian)
    if float(away[0] @ np.linalg.solve(prepared[1] + noise[0], away[0])) > _CHI2:
        return False
    ekf.update(columns, jacobian, away, noise, prepared)
    return True
