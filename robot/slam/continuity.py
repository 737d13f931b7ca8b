"""Does a frame go on from the last one, or does it show another place?

A crowd of points never ends from one frame to the next, in a picture as good as the last, unless
somebody carried the robot. Where there was no crowd the walls tell: they stand where they stood.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from robot.geometry.se2 import SE2
from robot.messages import Scan, Seen

CROWD, GROUP = 40, 20  # points that tell a motion
NEXT_NS = 250_000_000  # if the next frame follows so soon
READABLE = 0.5  # and has so much of its quality: no dark, no wall before the eyes
KEPT = 0.125  # of the tracks seem to go on elsewhere, by likeness
SEES = 0.1  # of less quality is a wall right before the eyes, whose ranges are worth nothing
OTHER_QUALITY = 3.0  # times better or worse at once: another picture
BEARINGS, SAME = 8, 0.25  # in so many both scans know a wall, of so few it is the same
NEAR_M = 2.5  # ranges are good enough so far
SLACK_M, SLACK_PER_M2 = 0.08, 0.06  # and differ by so much at most
BESIDE_RAD = 0.03  # bearings that show the same

Change = Literal["none", "broken", "carried"]


class Continuity:
    """Every frame is compared with the last."""

    def __init__(self) -> None:
        self._followed: set[int] = set()  # tracks of the last frame
        self._held = 0  # points that told its motion
        self._quality, self._t_ns = 0.0, 0
        self._hits_m = np.zeros((0, 2))  # what its scan met, in `base` now

    def moved(self, previous_from_current: SE2) -> None:
        """Carry what was seen along with the odometry."""
        self._hits_m = previous_from_current.inverse().apply(self._hits_m)

    def follow(self, seen: Seen) -> Change:
        """Whether this frame goes on from the last, tells nothing of it, or cannot follow it."""
        tracks = {landmark.track_id for landmark in seen.landmarks if landmark.track_id >= 0}
        kept = len(tracks & self._followed)
        change: Change = "none"
        if seen.motion is None:
            soon = seen.t_ns - self._t_ns < NEXT_NS
            carried = soon and (self._crowd_ends(seen, kept) or (not kept and self._cut(seen)))
            change = "carried" if carried else "none" if kept else "broken"
        self._followed, self._held = tracks, 0 if seen.motion is None else seen.motion.inliers
        self._quality, self._t_ns = seen.quality, seen.t_ns
        self._hits_m = hits(seen.scan)
        return change

    def _crowd_ends(self, seen: Seen, kept: int) -> bool:
        readable = seen.quality >= READABLE * self._quality
        return self._held >= CROWD and kept <= KEPT * len(self._followed) and readable

    def _cut(self, seen: Seen) -> bool:
        """Whether the walls stand elsewhere, and the picture is another one, too."""
        low, high = sorted((seen.quality, self._quality))
        if low < SEES or (self._held < GROUP and high < OTHER_QUALITY * low):
            return False
        common, same = agreement(self._hits_m, hits(seen.scan))
        return common >= BEARINGS and same < SAME * common


def hits(scan: Scan) -> np.ndarray:
    """Where near rays ended, (n, 2) in `base`."""
    near = np.isfinite(scan.range_m) & (scan.range_m < NEAR_M)
    range_m, bearing_rad = scan.range_m[near], scan.bearing_rad[near]
    return np.stack([range_m * np.cos(bearing_rad), range_m * np.sin(bearing_rad)], axis=-1)


def agreement(before_m: np.ndarray, now_m: np.ndarray) -> tuple[int, int]:
    """Of points `now_m` (n, 2): those in a bearing of some of `before_m` (m, 2), and the same."""
    if len(before_m) < 2 or len(now_m) == 0:
        return 0, 0
    bearing, range_m = _polar(before_m)
    order = np.argsort(bearing)
    bearing, range_m = bearing[order], range_m[order]
    now_rad, now_range_m = _polar(now_m)
    right = np.clip(np.searchsorted(bearing, now_rad), 1, len(bearing) - 1)
    pair = np.stack([right - 1, right])
    beside = np.abs(bearing[pair] - now_rad) < BESIDE_RAD
    off_m = np.where(beside, np.abs(range_m[pair] - now_range_m), np.inf).min(axis=0)
    same = off_m < SLACK_M + SLACK_PER_M2 * now_range_m**2
    return int(beside.any(axis=0).sum()), int(same.sum())


def _polar(points_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.arctan2(points_m[:, 1], points_m[:, 0]), np.hypot(points_m[:, 0], points_m[:, 1])
