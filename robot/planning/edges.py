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
    """A polyline (n, 2) in cells; a closed one begins anywhere (its last point is the first).

    `gain` is how many cells it sweeps that nothing before it swept.
    """

    points: np.ndarray
    closed: bool
    area: int
    gain: int


def edge_chains(
    space: Space, todo: np.ndarray, areas: np.ndarray, brush_m: float
) -> tuple[list[Chain], np.ndarray]:
    """Chains along matter that sweep cells of `todo`, and what of `todo` they leave over.

    A chain stays in one of the `areas` (int32 labels of the space's shape).
    """
    left = todo.astype(np.uint8)
    chains: list[Chain] = []
    contours, _ = cv2.findContours(
        space.centres.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE
    )
    gradient = _gradient(space.clearance_m)
    for contour in sorted(contours, key=len, reverse=True):
        if len(contour) >= 4:
            points, real = _on_level(space, gradient, contour[:, 0, :].astype(float))
            chains += _useful(space, points, real, left, areas, brush_m)
    return chains, left > 0


def paint(mask: np.ndarray, points: np.ndarray, width_cells: float) -> None:
    """Set to 0 what a brush of `width_cells` surely sweeps, driven not quite along the polyline."""
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
    space: Space,
    points: np.ndarray,
    real: np.ndarray,
    left: np.ndarray,
    areas: np.ndarray,
    brush_m: float,
) -> list[Chain]:
    """Cut a contour into chains that sweep something; paints what they sweep out of `left`."""
    width = brush_m / space.cell_m
    size = max(1, round(_PIECE_M / space.cell_m))
    pieces = [
        np.arange(i, min(i + size, len(points)) + 1) % len(points)
        for i in range(0, len(points), size)
    ]
    least = _NEW_SHARE * width
    gain = np.zeros(len(pieces), int)
    for k, index in enumerate(pieces):
        if real[index].mean() >= 0.5:
            gain[k] = _swept(left, points[index], width, least * (len(index) - 1))
    middles = np.rint(points[[index[len(index) // 2] for index in pieces]]).astype(int)
    labels = areas[middles[:, 1], middles[:, 0]]
    chains = []
    for run in _runs(gain > 0, labels, max(1, round(_BRIDGE_M / _PIECE_M))):
        closed = len(run) == len(pieces)
        index = np.concatenate([pieces[run[0]][:1], *(pieces[k][1:] for k in run)])
        line = simplified(points[index], _LINE_CELLS)
        chains.append(Chain(line, closed, int(labels[run[0]]), int(gain[run].sum())))
    return chains


def _swept(left: np.ndarray, piece: np.ndarray, width: float, least: float) -> int:
    """Cells that a piece sweeps anew, painted out of `left`; 0, and no change, below `least`."""
    x0, y0 = np.maximum(np.floor(piece.min(axis=0) - width).astype(int), 0)
    x1, y1 = np.ceil(piece.max(axis=0) + width).astype(int) + 1
    part = left[y0:y1, x0:x1]
    before = int(np.count_nonzero(part))
    if before < least:
        return 0
    after = part.copy()
    paint(after, piece - (x0, y0), width)
    new = before - int(np.count_nonzero(after))
    if new < least:
        return 0
    part[...] = after
    return new


def _runs(useful: np.ndarray, labels: np.ndarray, bridge: int) -> list[np.ndarray]:
    """Runs of useful pieces of one label on a ring, as piece numbers; short gaps are bridged."""
    n = len(useful)
    on = np.flatnonzero(useful)
    if len(on) == 0:
        return []
    after = np.append(on[1:], on[0] + n)
    breaks = np.flatnonzero((after - on - 1 > bridge) | (labels[after % n] != labels[on]))
    if len(breaks) == 0:
        return [np.arange(n)]
    runs = []
    for i, b in enumerate(breaks):
        first = int(on[(b + 1) % len(on)])
        last = int(on[breaks[(i + 1) % len(breaks)]])
        runs.append(np.arange(first, last + 1 + (n if last < first else 0)) % n)
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
