"""The edge pass: along walls and furniture, as near as the robot's radius allows.

The way is the contour of the reachable centres, moved onto the exact level line of the clearance
(so that it does not step with the cells) and kept only where it sweeps new floor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from robot.planning.costmap import Space

_SMOOTH_M = 0.06
_LINE_CELLS = 0.35  # how far corners may be left out of the line
_PIECE_M = 0.10
_BRIDGE_M = 0.30  # gaps in a chain shorter than this are driven through
_NEW_SHARE = 0.2  # a piece is worth driving if it sweeps this share of its length anew


@dataclass(frozen=True, slots=True, eq=False)
class Chain:
    """A polyline (n, 2) in cells; a closed one begins anywhere (its last point is the first)."""

    points: np.ndarray
    closed: bool


def edge_chains(space: Space, todo: np.ndarray, brush_m: float) -> tuple[list[Chain], np.ndarray]:
    """Chains along matter that sweep cells of `todo`, and what of `todo` they leave over."""
    left = todo.astype(np.uint8)
    chains: list[Chain] = []
    contours, _ = cv2.findContours(
        space.centres.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE
    )
    gradient = _gradient(space.clearance_m)
    for contour in sorted(contours, key=len, reverse=True):
        if len(contour) >= 4:
            points, real = _on_level(space, gradient, contour[:, 0, :].astype(float))
            chains += _useful(space, points, real, left, brush_m)
    return chains, left > 0


def paint(mask: np.ndarray, points: np.ndarray, width_cells: float) -> None:
    """Set to 0 what a brush of `width_cells` surely sweeps along the polyline."""
    # cv2 draws lines up to a cell wider than asked.
    pixels = np.rint(np.asarray(points) * 16.0).astype(np.int32).reshape(-1, 1, 2)
    cv2.polylines(mask, [pixels], False, 0, max(1, round(width_cells) - 1), cv2.LINE_8, 4)


def _gradient(clearance_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    gx = cv2.Sobel(clearance_m, cv2.CV_32F, 1, 0, scale=1.0 / 8.0)
    gy = cv2.Sobel(clearance_m, cv2.CV_32F, 0, 1, scale=1.0 / 8.0)
    return gx, gy


def _sample(layer: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Bilinear samples of a float layer at points (n, 2) in cells."""
    mx = points[:, 0].astype(np.float32).reshape(1, -1)
    my = points[:, 1].astype(np.float32).reshape(1, -1)
    return cv2.remap(layer, mx, my, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)[0]


def _on_level(
    space: Space, gradient: tuple[np.ndarray, np.ndarray], points: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The closed contour moved onto clearance = need and smoothed, and where matter bounds it."""
    real = _sample(space.clearance_m, points) < space.need_m + 1.6 * space.cell_m
    # Cells step, and walls seen from afar are ragged: even that out before, not after, the level.
    moved = _smooth(points, _SMOOTH_M / space.cell_m)
    for k in range(5):
        gx, gy = _sample(gradient[0], moved), _sample(gradient[1], moved)
        norm = np.maximum(np.hypot(gx, gy), 1e-6)
        lack = (space.need_m - _sample(space.clearance_m, moved)) / space.cell_m
        # Towards matter only a little: gaps in a ragged wall need no visit.
        step = np.clip(lack, -0.5, 0.8) / norm
        moved = np.where(real[:, None], moved + np.stack([gx, gy], 1) * step[:, None], moved)
        if k < 3:
            moved = _smooth(moved, 1.0)
    keeps = _sample(space.clearance_m, moved) >= space.need_m - 0.4 * space.cell_m
    return np.where((keeps & real)[:, None], moved, points), real


def _smooth(points: np.ndarray, sigma: float) -> np.ndarray:
    """Gaussian of `sigma` points along a closed line."""
    reach = int(np.ceil(3.0 * sigma))
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    ring = np.take(points, np.arange(-reach, len(points) + reach), axis=0, mode="wrap")
    columns = [np.convolve(ring[:, k], kernel / kernel.sum(), "valid") for k in (0, 1)]
    return np.stack(columns, axis=1)


def _useful(
    space: Space, points: np.ndarray, real: np.ndarray, left: np.ndarray, brush_m: float
) -> list[Chain]:
    """Cut a contour into chains that sweep something; paints what they sweep out of `left`."""
    width = brush_m / space.cell_m
    size = max(1, round(_PIECE_M / space.cell_m))
    starts = list(range(0, len(points), size))
    useful = np.zeros(len(starts), bool)
    new_cells = _NEW_SHARE * width * size
    for k, i in enumerate(starts):
        index = np.arange(i, min(i + size, len(points)) + 1) % len(points)
        if real[index].mean() < 0.5:
            continue
        piece = points[index]
        x0, y0 = np.maximum(np.floor(piece.min(axis=0) - width).astype(int), 0)
        x1, y1 = np.ceil(piece.max(axis=0) + width).astype(int) + 1
        part = left[y0:y1, x0:x1]
        before = int(np.count_nonzero(part))
        if before < new_cells:
            continue
        after = part.copy()
        paint(after, piece - (x0, y0), width)
        if before - int(np.count_nonzero(after)) >= new_cells * (len(index) - 1) / size:
            useful[k] = True
            part[...] = after
    chains = []
    bridge = max(1, round(_BRIDGE_M / _PIECE_M))
    for first, last in _runs(useful, bridge):
        if last - first >= len(starts):
            chains.append(Chain(simplified(np.vstack([points, points[:1]]), _LINE_CELLS), True))
            continue
        index = np.arange(starts[first], starts[first] + (last - first) * size + 1) % len(points)
        if last > len(starts):  # the run goes over the contour's seam, whose piece may be short
            index = np.concatenate(
                [
                    np.arange(starts[first], len(points)),
                    np.arange(0, (last - len(starts)) * size + 1),
                ]
            ) % len(points)
        chains.append(Chain(simplified(points[index], _LINE_CELLS), False))
    return chains


def _runs(useful: np.ndarray, bridge: int) -> list[tuple[int, int]]:
    """Half-open runs of True on a ring, gaps of up to `bridge` closed; (0, n) is the whole ring."""
    n = len(useful)
    on = np.flatnonzero(useful)
    if len(on) == 0:
        return []
    gaps = np.diff(np.append(on, on[0] + n)) - 1
    breaks = np.flatnonzero(gaps > bridge)
    if len(breaks) == 0:
        return [(0, n)]
    runs = []
    for i, b in enumerate(breaks):
        first = int(on[(b + 1) % len(on)])
        last = int(on[breaks[(i + 1) % len(breaks)]]) + 1
        runs.append((first, last if last > first else last + n))
    return runs


def simplified(points: np.ndarray, tolerance: float) -> np.ndarray:
    """Fewer points (m, 2) of the same line, none farther than `tolerance` from the new one.

    Douglas and Peucker, Cartographica 1973 (cv2's version drops corners of lines that end where
    they begin).
    """
    keep = np.zeros(len(points), bool)
    keep[[0, -1]] = True
    stack = [(0, len(points) - 1)]
    while stack:
        first, last = stack.pop()
        if last - first < 2:
            continue
        a, leg = points[first], points[last] - points[first]
        inner = points[first + 1 : last] - a
        far = math.hypot(leg[0], leg[1])
        if far > 1e-9:
            along = np.clip(inner @ leg / far**2, 0.0, 1.0)
            off = np.hypot(*(inner - along[:, None] * leg).T)
        else:
            off = np.hypot(*inner.T)
        k = int(off.argmax())
        if off[k] > tolerance:
            middle = first + 1 + k
            keep[middle] = True
            stack += [(first, middle), (middle, last)]
    return points[keep]
