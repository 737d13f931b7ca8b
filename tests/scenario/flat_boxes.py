"""The world of the light flat: boxes on a raster, with distance fields and landmarks."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np

from robot.geometry.se2 import SE2

CELL_M = 0.01
Box = tuple[float, float, float, float]  # x0, y0, x1, y1 in metres


class Flat:
    """Walls and furniture as boxes in a rectangle; the dock's plate is one of them."""

    def __init__(
        self,
        width_m: float,
        height_m: float,
        boxes: Sequence[Box],
        start: SE2,
        invisible: Sequence[Box] = (),
        cliffs: Sequence[Box] = (),
    ) -> None:
        shape = (round(height_m / CELL_M), round(width_m / CELL_M))
        self.start = start
        self.seen = np.zeros(shape, bool)
        self.seen[:3], self.seen[-3:], self.seen[:, :3], self.seen[:, -3:] = True, True, True, True
        for box in boxes:
            self._fill(self.seen, box)
        self.solid = self.seen.copy()
        for box in invisible:
            self._fill(self.solid, box)
        self.cliff = np.zeros(shape, bool)
        for box in cliffs:
            self._fill(self.cliff, box)
        self.update()
        self.landmarks_m = self._landmarks()
        draw = np.random.default_rng(len(self.landmarks_m))
        self.signatures = [draw.bytes(32) for _ in self.landmarks_m]

    @staticmethod
    def _fill(mask: np.ndarray, box: Box) -> None:
        x0, y0, x1, y1 = (round(v / CELL_M) for v in box)
        mask[max(0, y0) : y1, max(0, x0) : x1] = True

    def _landmarks(self) -> np.ndarray:
        """Points (n, 2) on visible surfaces, about one every half metre."""
        edge = cv2.dilate(self.seen.astype(np.uint8), np.ones((3, 3), np.uint8)) & ~self.seen
        taken = np.zeros(edge.shape, np.uint8)
        points = []
        for y, x in zip(*np.nonzero(edge), strict=True):
            if not taken[y, x]:
                points.append(((x + 0.5) * CELL_M, (y + 0.5) * CELL_M))
                cv2.circle(taken, (int(x), int(y)), 45, 1, -1)
        return np.array(points)

    def update(self) -> None:
        """Recompute the distance fields after the masks were changed."""
        self.solid_m = _distance(self.solid)
        self.seen_m = _distance(self.seen)

    def put(
        self, box: Box, *, visible: bool = True, but: tuple[float, float, float] = (0, 0, 0)
    ) -> None:
        """Place something while the robot is at work, with a round hole `but` (x, y, radius)."""
        fresh = np.zeros(self.solid.shape, bool)
        self._fill(fresh, box)
        ys, xs = np.nonzero(fresh)
        hole = np.hypot((xs + 0.5) * CELL_M - but[0], (ys + 0.5) * CELL_M - but[1]) < but[2]
        fresh[ys[hole], xs[hole]] = False
        self.solid |= fresh
        if visible:
            self.seen |= fresh
        self.update()

    def reachable(self, radius_m: float, brush_m: float) -> np.ndarray:
        """Cells that the brush can sweep from centres connected to the start."""
        ok = (self.solid_m >= radius_m) & (_distance(self.cliff) >= radius_m)
        _, labels = cv2.connectedComponents(ok.astype(np.uint8), connectivity=4)
        out = self.start @ SE2(-0.3)
        centres = labels == labels[int(out.y_m / CELL_M), int(out.x_m / CELL_M)]
        size = 2 * round(brush_m / 2 / CELL_M) + 1
        kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
        return cv2.dilate(centres.astype(np.uint8), kernel).astype(bool) & ~self.solid


def _distance(mask: np.ndarray) -> np.ndarray:
    if not mask.any():
        return np.full(mask.shape, 10.0, np.float32)
    return cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, 5) * CELL_M - CELL_M / 2


def small_flat(**extra: Sequence[Box]) -> Flat:
    """Three small rooms, 3.4 m by 2.6 m, with a bed, a table's legs and a dock on the left wall."""
    boxes: list[Box] = [
        (1.75, 0.0, 1.85, 1.0),  # wall between left and right, with a door
        (1.75, 1.65, 1.85, 2.6),
        (1.85, 1.30, 2.55, 1.40),  # wall between the right rooms, with a door
        (3.25, 1.30, 3.40, 1.40),
        (0.03, 2.0, 0.75, 2.57),  # a chest
        (2.9, 0.03, 3.37, 0.45),  # a cupboard
        (0.03, 1.1, 0.10, 1.3),  # the dock
    ]
    return Flat(3.4, 2.6, boxes, SE2(0.10 + 0.17, 1.2, math.pi), **extra)


def one_room(**extra: Sequence[Box]) -> Flat:
    """An empty room, 2 m by 1.6 m, with the dock on its left wall."""
    return Flat(2.0, 1.6, [(0.03, 0.7, 0.10, 0.9)], SE2(0.27, 0.8, math.pi), **extra)
