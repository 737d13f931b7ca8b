"""Does the robot know the place it sees? What it sees is compared with the map."""

from __future__ import annotations

import math
from collections import deque

import cv2
import numpy as np

from robot.geometry.se2 import SE2
from robot.messages import Grid, Scan

REACH_M = 1.8  # ranges are good enough so far
NEAR_M = 0.08  # a hit so near to matter of the map is known
MEMORY = 150.0  # hits: some frames' worth
FADE = 0.8  # of them stays with every frame: a few false ones in wide rooms never make a view
MIN_HITS = 40.0
RECENT_NS = 2_000_000_000  # what was seen so lately is tried at another pose


class Recognition:
    """A fading count of what was seen, and of what of it the map knows."""

    def __init__(self) -> None:
        self._recent: deque[tuple[int, np.ndarray]] = deque()  # hits (n, 2) in odom
        self.forget()

    def forget(self) -> None:
        """Begin anew, at another place perhaps."""
        self._seen = self._known = 0.0
        self._all_seen = self._all_known = 0
        self._recent.clear()

    @property
    def share(self) -> float:
        """0 to 1; NaN while too little has been seen."""
        return self._known / self._seen if self._seen >= MIN_HITS else math.nan

    @property
    def whole_share(self) -> float:
        """The same of all that was seen since it began anew."""
        return self._all_known / self._all_seen if self._all_seen >= MIN_HITS else math.nan

    def look(self, t_ns: int, odom_from_base: SE2, scan: Scan) -> None:
        """Take in a scan with the odometry pose at the time of its frame."""
        while self._recent and t_ns - self._recent[0][0] > RECENT_NS:
            self._recent.popleft()
        self._recent.append((t_ns, odom_from_base.apply(_hits(scan))))

    def share_at(self, grid: Grid, world_from_odom: SE2) -> float:
        """What `share` would be, were odometry's frame there: of all that was seen lately."""
        hits = np.vstack([points for _, points in self._recent] or [np.zeros((0, 2))])
        if len(hits) < MIN_HITS:
            return math.nan
        return float(_near_matter(grid, world_from_odom.apply(hits)).mean())

    def see(self, grid: Grid, world_from_base: SE2, scan: Scan) -> None:
        """Add a scan taken from where the robot believes to be."""
        hits = world_from_base.apply(_hits(scan))
        known = int(_near_matter(grid, hits).sum())
        keep = min(FADE, max(0.0, MEMORY - len(hits)) / max(self._seen, 1e-9))
        self._seen = self._seen * keep + len(hits)
        self._known = self._known * keep + known
        self._all_seen, self._all_known = self._all_seen + len(hits), self._all_known + known


def _hits(scan: Scan) -> np.ndarray:
    """Where near rays ended, (n, 2) in `base`."""
    use = np.isfinite(scan.range_m) & (scan.range_m < REACH_M)
    r, b = scan.range_m[use], scan.bearing_rad[use]
    return np.stack([r * np.cos(b), r * np.sin(b)], axis=-1)


def _near_matter(grid: Grid, points_m: np.ndarray) -> np.ndarray:
    """Which of the points (n, 2) of `world` lie close to an occupied cell."""
    res = grid.resolution_m
    origin = np.array([grid.origin_x_m, grid.origin_y_m])
    cells = np.floor((points_m - origin) / res).astype(int)
    rows, columns = grid.cells.shape
    inside = (cells >= 0).all(axis=1) & (cells[:, 0] < columns) & (cells[:, 1] < rows)
    near = np.zeros(len(points_m), bool)
    if not inside.any():
        return near
    pad = math.ceil(NEAR_M / res)
    low = np.maximum(cells[inside].min(axis=0) - pad, 0)
    high = cells[inside].max(axis=0) + pad + 1
    matter = (grid.cells[low[1] : high[1], low[0] : high[0]] >= 50).astype(np.uint8)
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * pad + 1, 2 * pad + 1))
    grown = cv2.dilate(matter, kernel)
    at = cells[inside] - low
    near[inside] = grown[at[:, 1], at[:, 0]] > 0
    return near
