"""No-go areas and virtual walls on a grid: for the planner they are matter."""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np

from robot.mapping.annotations import Annotations, Area, Point
from robot.messages import Grid

_SHIFT = 8  # binary digits below a cell in cv2's drawing


def forbid(grid: Grid, annotations: Annotations, margin_m: float) -> Grid:
    """The grid with every forbidden cell occupied, and those within `margin_m` of one."""
    if not annotations.no_go and not annotations.walls:
        return grid
    mask = np.zeros(grid.cells.shape, np.uint8)
    for area in annotations.no_go:
        cv2.fillPoly(mask, [_pixels(grid, area.corners_m)], 1, shift=_SHIFT)
    width = 1 + 2 * math.ceil(margin_m / grid.resolution_m)
    for line in annotations.barriers():
        (ax, ay), (bx, by) = _pixels(grid, line).tolist()
        cv2.line(mask, (ax, ay), (bx, by), 1, width, cv2.LINE_8, _SHIFT)
    cells = grid.cells.copy()
    cells[mask > 0] = 100
    return replace(grid, cells=cells)


def areas_mask(grid: Grid, areas: tuple[Area, ...]) -> np.ndarray:
    """Bool array of the grid's shape: cells whose centre lies in one of the areas."""
    mask: np.ndarray = np.zeros_like(grid.cells, np.uint8)
    rows, columns = mask.shape
    x = grid.origin_x_m + (np.arange(columns) + 0.5) * grid.resolution_m
    y = grid.origin_y_m + (np.arange(rows) + 0.5) * grid.resolution_m
    for area in areas:
        xs, ys = zip(*area.corners_m, strict=True)
        i = np.flatnonzero((y >= min(ys)) & (y <= max(ys)))
        j = np.flatnonzero((x >= min(xs)) & (x <= max(xs)))
        if len(i) and len(j):
            box = (slice(i[0], i[-1] + 1), slice(j[0], j[-1] + 1))
            mask[box] |= _inside(area, x[box[1]], y[box[0]])
    return mask > 0


def _inside(area: Area, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Even-odd rule on a raster."""
    inside = np.zeros((len(y), len(x)), bool)
    for (ax, ay), (bx, by) in area.sides():
        if ay == by:
            continue
        crosses = (ay > y) != (by > y)
        at = ax + (y - ay) * (bx - ax) / (by - ay)
        inside ^= crosses[:, None] & (x[None, :] < at[:, None])
    return inside


def _pixels(grid: Grid, points: tuple[Point, ...]) -> np.ndarray:
    """Points in cv2's fixed-point cells (n, 2), int32."""
    origin = np.array([grid.origin_x_m, grid.origin_y_m])
    cells = (np.array(points) - origin) / grid.resolution_m - 0.5
    return np.rint(cells * (1 << _SHIFT)).astype(np.int32)
