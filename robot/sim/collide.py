"""Distances to outlines (numba): for the robot's rim at each step, and over a whole raster."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

_STEPS = 48  # of a ray; it ends early beside a wall that it runs along


@njit(cache=True)
def nearest(segments, x, y, from_m):  # type: ignore[no-untyped-def]
    """(distance, nx, ny) of the closest of segments (n, 4) nearer than `from_m`; n points away."""
    best, nx, ny = from_m, 0.0, 0.0
    for i in range(segments.shape[0]):
        ax, ay = segments[i, 0], segments[i, 1]
        bx, by = segments[i, 2] - ax, segments[i, 3] - ay
        px, py = x - ax, y - ay
        t = (px * bx + py * by) / (bx * bx + by * by + 1e-12)
        t = min(max(t, 0.0), 1.0)
        dx, dy = px - t * bx, py - t * by
        d = math.sqrt(dx * dx + dy * dy)
        if d < best:
            best, nx, ny = d, dx / max(d, 1e-9), dy / max(d, 1e-9)
    return best, nx, ny


@njit(cache=True)
def inside(polygon, x, y):  # type: ignore[no-untyped-def]
    """Whether a point lies in a polygon (even-odd rule)."""
    within = False
    j = polygon.shape[0] - 1
    for i in range(polygon.shape[0]):
        xi, yi, xj, yj = polygon[i, 0], polygon[i, 1], polygon[j, 0], polygon[j, 1]
        if (yi > y) != (yj > y) and x < (xj - xi) * (y - yi) / (yj - yi) + xi:
            within = not within
        j = i
    return within


@njit(cache=True)
def _spread(segments, x0, y0, resolution, reach, clearance):  # type: ignore[no-untyped-def]
    rows, columns = clearance.shape
    for i in range(segments.shape[0]):
        ax, ay, ex, ey = segments[i, 0], segments[i, 1], segments[i, 2], segments[i, 3]
        bx, by = ex - ax, ey - ay
        low_c = max(0, int((min(ax, ex) - reach - x0) / resolution))
        high_c = min(columns, int((max(ax, ex) + reach - x0) / resolution) + 1)
        low_r = max(0, int((min(ay, ey) - reach - y0) / resolution))
        high_r = min(rows, int((max(ay, ey) + reach - y0) / resolution) + 1)
        for r in range(low_r, high_r):
            py = y0 + (r + 0.5) * resolution - ay
            for c in range(low_c, high_c):
                px = x0 + (c + 0.5) * resolution - ax
                t = min(max((px * bx + py * by) / (bx * bx + by * by + 1e-12), 0.0), 1.0)
                d = math.hypot(px - t * bx, py - t * by)
                if d < clearance[r, c]:
                    clearance[r, c] = d


@njit(cache=True)
def march(far, cell, x0, y0, x, y, angle):  # type: ignore[no-untyped-def]
    """Distances (n,) from x, y along each angle (n,) to matter: by steps through the distances
    `far` (rows, columns) of cells to the nearest matter, the first cell's corner at x0, y0.
    """
    rows, columns = far.shape
    reach = np.zeros(len(angle))
    for i in range(len(angle)):
        c, s = math.cos(angle[i]), math.sin(angle[i])
        for _ in range(_STEPS):
            column = min(max(int((x + reach[i] * c - x0) / cell), 0), columns - 1)
            row = min(max(int((y + reach[i] * s - y0) / cell), 0), rows - 1)
            if far[row, column] <= 0.0:
                break
            reach[i] += far[row, column]
    return reach


def clearance_m(
    segments: np.ndarray,
    x0_m: float,
    y0_m: float,
    resolution_m: float,
    shape: tuple[int, int],
    reach_m: float,
) -> np.ndarray:
    """Distance (rows, columns) of cell centres to segments (n, 4); infinite beyond `reach_m`."""
    clearance = np.full(shape, np.inf)
    _spread(np.ascontiguousarray(segments), x0_m, y0_m, resolution_m, reach_m, clearance)
    return clearance
