"""Rooms as people know them: found by their doors, then cut, joined and named by hand."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from robot.errors import MapError
from robot.mapping.annotations import Annotations, Point
from robot.messages import Grid

_NEAR_M = 0.4  # a place so near to a room belongs to it
_MIN_PART_M2 = 0.25  # what a cut leaves must be larger


@dataclass(frozen=True, slots=True, eq=False)
class Rooms:
    """Rooms 1, 2, ... by falling area: `labels` int32 of the grid's shape, and their names."""

    grid: Grid
    labels: np.ndarray
    names: tuple[str, ...]

    def number(self, name: str) -> int:
        """The room with this name; capitals do not matter, and a hyphen may stand for a space.

        Raises MapError when there is none.
        """
        for number, known in enumerate(self.names, 1):
            if _plain(known) == _plain(name):
                return number
        listed = ", ".join(self.names) or "none yet, let the robot clean once"
        raise MapError(f"no room is called {name!r}; there is: {listed}.")

    def area_m2(self, number: int) -> float:
        """Free floor of a room."""
        return float(np.count_nonzero(self.labels == number)) * self.grid.resolution_m**2

    def middle_m(self, number: int) -> Point:
        """The place in a room that is farthest from everything else."""
        inside = np.pad(self.labels == number, 1).astype(np.uint8)
        far = cv2.distanceTransform(inside, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[1:-1, 1:-1]
        row, column = np.unravel_index(int(far.argmax()), far.shape)
        res = self.grid.resolution_m
        return (
            self.grid.origin_x_m + (float(column) + 0.5) * res,
            self.grid.origin_y_m + (float(row) + 0.5) * res,
        )

    def on(self, grid: Grid, numbers: tuple[int, ...]) -> np.ndarray:
        """Bool array of another grid of the same lattice: the cells of these rooms."""
        res = grid.resolution_m
        dx = round((grid.origin_x_m - self.grid.origin_x_m) / res)
        dy = round((grid.origin_y_m - self.grid.origin_y_m) / res)
        mask: np.ndarray = np.zeros_like(grid.cells, bool)
        rows, columns = self.labels.shape
        high, wide = min(mask.shape[0], rows - dy), min(mask.shape[1], columns - dx)
        y0, x0 = max(0, -dy), max(0, -dx)
        if high > y0 and wide > x0:
            part = self.labels[y0 + dy : high + dy, x0 + dx : wide + dx]
            mask[y0:high, x0:wide] = np.isin(part, numbers)
        return mask


def make_rooms(grid: Grid, found: np.ndarray, annotations: Annotations) -> Rooms:
    """From rooms as found (`segment_rooms` of `grid`) to rooms as people want them."""
    labels = found.astype(np.int32)
    for cut in annotations.cuts:
        labels = _cut(grid, labels, cut.start_m, cut.end_m)
    for join in annotations.joins:
        one, other = room_at(grid, labels, join.one_m), room_at(grid, labels, join.other_m)
        if one and other:
            labels[labels == other] = one
    labels = _numbered(labels)
    names: dict[int, str] = {}
    for mark in annotations.rooms:
        number = room_at(grid, labels, mark.at_m)
        if number and mark.name not in names.values():
            names.setdefault(number, mark.name)
    count = int(labels.max(initial=0))
    return Rooms(grid, labels, tuple(names.get(i, f"room {i}") for i in range(1, count + 1)))


def _plain(name: str) -> str:
    return name.casefold().replace("-", " ")


def room_at(grid: Grid, labels: np.ndarray, at_m: Point) -> int:
    """Number of the room at a place, or of the nearest one close by; 0: none."""
    res = grid.resolution_m
    column, row = (at_m[0] - grid.origin_x_m) / res - 0.5, (at_m[1] - grid.origin_y_m) / res - 0.5
    reach = _NEAR_M / res
    y0, y1 = max(0, int(row - reach)), max(0, int(row + reach) + 2)
    x0, x1 = max(0, int(column - reach)), max(0, int(column + reach) + 2)
    part = labels[y0:y1, x0:x1]
    ys, xs = np.nonzero(part)
    if len(ys) == 0:
        return 0
    away = np.hypot(ys + y0 - row, xs + x0 - column)
    best = int(away.argmin())
    return int(part[ys[best], xs[best]]) if away[best] <= reach else 0


def splits(grid: Grid, labels: np.ndarray, start_m: Point, end_m: Point) -> bool:
    """Whether a line would divide a room."""
    return int(_cut(grid, labels, start_m, end_m).max()) > int(labels.max())


def _cut(grid: Grid, labels: np.ndarray, start_m: Point, end_m: Point) -> np.ndarray:
    """Every room that the line crosses from border to border falls into parts."""
    line = np.zeros(labels.shape, np.uint8)
    origin = np.array([grid.origin_x_m, grid.origin_y_m])
    a, b = (
        np.rint((np.array(p) - origin) / grid.resolution_m - 0.5).astype(int).tolist()
        for p in (start_m, end_m)
    )
    cv2.line(line, a, b, 1, 2)
    out, least = labels.copy(), _MIN_PART_M2 / grid.resolution_m**2
    for room in np.unique(labels[line > 0]):
        if room == 0:
            continue
        inside = labels == room
        _, parts, stats, _ = cv2.connectedComponentsWithStats(
            (inside & (line == 0)).astype(np.uint8), connectivity=4
        )
        areas = stats[1:, cv2.CC_STAT_AREA]
        large = 1 + np.flatnonzero(areas >= least)
        if len(large) < 2:
            continue
        largest = 1 + int(areas.argmax())
        for part in large[large != largest]:
            ring = cv2.dilate((parts == part).astype(np.uint8), np.ones((3, 3), np.uint8))
            out[inside & (ring > 0)] = out.max() + 1
    return out


def _numbered(labels: np.ndarray) -> np.ndarray:
    """Rooms by falling area."""
    areas = np.bincount(labels.ravel())
    areas[0] = 0
    order = np.argsort(-areas, kind="stable")[: np.count_nonzero(areas)]
    number = np.zeros(len(areas), np.int32)
    number[order] = np.arange(1, len(order) + 1)
    numbered: np.ndarray = number[labels]
    return numbered
