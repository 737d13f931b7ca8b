"""Vertical edges as landmarks: found in both eyes, described, and followed over frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robot.config import PerceptionConfig
from robot.geometry.stereo import StereoCamera
from robot.messages import Landmark
from robot.perception.descriptor import Describer
from robot.perception.landmarks import PATCH_INSIDE, PATCH_M, polar
from robot.perception.tracks import TrackIds, turned
from robot.perception.vertical_edges import Lines, find_lines, place_lines, slopes_of

AGREE_PX = 1.5  # with the dense matcher beside the edge
STRENGTH_RATIO = 0.6
BESIDE_PX = (2, 5)  # columns on either side that are asked for their disparity
MIN_KNOWN = 0.25
FOLLOW_PX = 7.0
FOLLOW_SHARE = 0.12  # change of disparity between frames
FOLLOW_BITS = 70
MAX_MISSED = 2  # frames that an edge may be hidden before it gets a new number
LOOK_HEIGHT_M = 0.15  # the description is cut at this height, wherever the edge ends
MAX_EDGES = 12
MAX_RANGE_M = 3.0  # beyond, a third of the matches is another edge


@dataclass(frozen=True, slots=True, eq=False)
class _Followed:
    """Edges of the last frames: column, disparity, sign, bits, number, age, frames missed."""

    u: np.ndarray
    d: np.ndarray
    sign: np.ndarray
    bits: np.ndarray
    track_id: np.ndarray
    age: np.ndarray
    missed: np.ndarray


class EdgeFinder:
    """Finds, measures and follows the vertical edges of each frame."""

    def __init__(self, config: PerceptionConfig, camera: StereoCamera, ids: TrackIds) -> None:
        self._config, self._camera, self._ids = config, camera, ids
        empty, none = np.empty(0), np.empty(0, np.int64)
        self._before = _Followed(empty, empty, none, np.empty((0, 32), np.uint8), none, none, none)
        self._frames, self._turned_rad = 0, 0.0

    def find(
        self,
        left: np.ndarray,
        right: np.ndarray,
        dense_px: np.ndarray,
        describer: Describer,
        yaw_rad: float,
    ) -> list[Landmark]:
        """Landmarks of kind "edge" of one frame (smoothed images, dense disparity (h, w)).

        `yaw_rad` is about how far the robot turned since the last frame. Of `edge_every` frames
        only one is searched: edges are long lived, and cost as much as all points together.
        """
        self._frames += 1
        self._turned_rad += yaw_rad
        if self._frames % self._config.edge_every:
            return []
        turned_rad, self._turned_rad = self._turned_rad, 0.0
        here, there = slopes_of(left), slopes_of(right)
        lines = find_lines(here, self._config.image_noise)
        near = _near_disparity(lines, dense_px)
        lines, near = lines[np.isfinite(near)], near[np.isfinite(near)]
        disparity = _match(here, there, lines, near)
        reach_m = min(self._config.landmark_range_m, MAX_RANGE_M)
        least = self._camera.focal_px * self._camera.baseline_m / reach_m
        with np.errstate(invalid="ignore"):
            good = disparity > least
        lines, disparity = lines[good], disparity[good]
        u = lines.at(self._camera.cy_px)
        look = self._look_at(lines, u, disparity)
        width = PATCH_M * disparity / self._camera.baseline_m
        inside = describer.inside(look, width, PATCH_INSIDE)
        sign, u, disparity, look, width = (
            a[inside] for a in (lines.sign, u, disparity, look, width)
        )
        bits = describer.describe(look, width)
        track_id, age = self._follow(u, disparity, sign, bits, turned_rad)
        return self._landmarks(u, disparity, bits, track_id, age)

    def _look_at(self, lines: Lines, u: np.ndarray, disparity: np.ndarray) -> np.ndarray:
        """Pixels (n, 2) on the edges at the height of the description, or as near as is seen."""
        rise = LOOK_HEIGHT_M - self._camera.base_from_cam[2, 3]
        v = self._camera.cy_px - rise * disparity / self._camera.baseline_m
        return np.stack([u, np.clip(v, lines.top, lines.bottom)], axis=1)

    def _landmarks(
        self,
        u: np.ndarray,
        disparity: np.ndarray,
        bits: np.ndarray,
        track_id: np.ndarray,
        age: np.ndarray,
    ) -> list[Landmark]:
        old = np.flatnonzero(age >= self._config.landmark_age)
        old = old[np.argsort(-age[old], kind="stable")][:MAX_EDGES]
        pixel = np.stack([u[old], np.full(len(old), self._camera.cy_px)], axis=1)
        range_m, bearing_rad, cov = polar(self._camera, pixel, disparity[old])
        return [
            Landmark(
                range_m=float(range_m[k]),
                bearing_rad=float(bearing_rad[k]),
                cov=cov[k],
                signature=bits[i].tobytes(),
                kind="edge",
                track_id=int(track_id[i]),
            )
            for k, i in enumerate(old.tolist())
        ]

    def _follow(
        self,
        u: np.ndarray,
        disparity: np.ndarray,
        sign: np.ndarray,
        bits: np.ndarray,
        yaw_rad: float,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Numbers and ages (n,) for this frame's edges; the nearest old edge hands on its own."""
        before, camera = self._before, self._camera
        level = np.column_stack([before.u, np.full(len(before.u), camera.cy_px)])
        away = np.abs(turned(level, yaw_rad, camera)[:, 0][None] - u[:, None])
        fits = (away < FOLLOW_PX) & (before.sign[None] == sign[:, None])
        fits &= (
            np.abs(before.d[None] - disparity[:, None]) < 1.0 + FOLLOW_SHARE * disparity[:, None]
        )
        words, old = (np.ascontiguousarray(b).view(np.uint64) for b in (bits, before.bits))
        differing = np.bitwise_count(old[None] ^ words[:, None]).sum(axis=2)
        fits &= differing < FOLLOW_BITS
        cost = away + 0.1 * differing
        track_id = np.full(len(u), -1, np.int64)
        age = np.zeros(len(u), np.int64)
        pairs = np.argwhere(fits)
        handed_on = set()
        for i, j in pairs[np.argsort(cost[fits], kind="stable")].tolist():
            if track_id[i] < 0 and j not in handed_on:
                track_id[i], age[i] = before.track_id[j], before.age[j] + 1
                handed_on.add(j)
        new = track_id < 0
        track_id[new] = self._ids.take(int(new.sum()))
        lost = ~np.isin(before.track_id, track_id) & (before.missed < MAX_MISSED)
        moved = turned(level, yaw_rad, camera)[:, 0]
        self._before = _Followed(
            np.concatenate([u, moved[lost]]),
            np.concatenate([disparity, before.d[lost]]),
            np.concatenate([sign, before.sign[lost]]),
            np.concatenate([bits, before.bits[lost]]),
            np.concatenate([track_id, before.track_id[lost]]),
            np.concatenate([age, before.age[lost]]),
            np.concatenate([np.zeros(len(u), np.int64), before.missed[lost] + 1]),
        )
        return track_id, age


def _near_disparity(lines: Lines, dense: np.ndarray) -> np.ndarray:
    """Median disparity (n,) of the nearer of the two sides of every edge, NaN if unknown.

    Every second row is asked.
    """
    near = np.full(len(lines.u), np.nan)
    first, last = BESIDE_PX
    for i in range(len(near)):
        column = round(float(lines.u[i]))
        rows = slice(int(lines.top[i]), int(lines.bottom[i]) + 1, 2)
        for start in (column - last, column + first):
            side = dense[rows, max(start, 0) : max(start + last - first + 1, 0)]
            ordered = np.sort(side, axis=None)  # NaN goes last
            known = int(np.count_nonzero(ordered == ordered))
            if known > MIN_KNOWN * max(side.size, 1):
                near[i] = np.fmax(near[i], ordered[(known - 1) // 2])
    return near


def _match(here: np.ndarray, there: np.ndarray, lines: Lines, near: np.ndarray) -> np.ndarray:
    """Disparity (n,) of edges between the gradients of both images, NaN without a partner.

    Both places are measured alike, so that whatever pulls them pulls both.
    """
    own, strength = place_lines(here, lines, np.zeros(len(near)))
    other, other_strength = place_lines(there, lines, near)
    weak, strong = np.minimum(strength, other_strength), np.maximum(strength, other_strength)
    with np.errstate(invalid="ignore"):
        good = (weak > STRENGTH_RATIO * strong) & (np.abs(other - own) < AGREE_PX)
    return np.where(good, near + own - other, np.nan)
