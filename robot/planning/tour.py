"""The order of the work: always the piece that is cheapest to begin from where the robot will be.

Cheap means near by the route that it must drive, straight ahead rather than behind, and an edge
rather than the lanes inside it. As the first piece is the one at the robot's feet, plans made one
after another over a growing map go on with the same work instead of running to and fro.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from robot.config import PlanningConfig
from robot.planning.costmap import Space
from robot.planning.edges import Chain
from robot.planning.lanes import Cell
from robot.planning.order import direction_rad, improved, turning_rad
from robot.planning.path import Lattice

_LANES_LATER_M = 0.4
_JOIN_M = 0.30  # a way that begins within this may be joined as far along it
_NEAR_M = (2.0, 6.0, math.inf)


def tour(
    space: Space,
    lattice: Lattice,
    pieces: Sequence[Chain | Cell],
    areas: np.ndarray,
    planning: PlanningConfig,
    horizon: float,
) -> list[np.ndarray]:
    """Polylines (n, 2) in cells that lead from the robot through every reachable piece in turn.

    The last one is cut where `horizon` cells have been driven.
    """
    return _Tour(space, lattice, pieces, areas, planning).lines(horizon)


class _Tour:
    def __init__(
        self,
        space: Space,
        lattice: Lattice,
        pieces: Sequence[Chain | Cell],
        areas: np.ndarray,
        planning: PlanningConfig,
    ) -> None:
        self._pieces = pieces
        self._areas = areas
        self._lattice = lattice
        self._space = space
        self._turn = planning.turn_cost_m / space.cell_m / (math.pi / 2.0)
        later = _LANES_LATER_M / space.cell_m
        # Cells of way for a cell of floor.
        self._reward = space.cell_m / max(planning.worth_m2_per_m, 1e-9)
        self._ways = [_ways(piece) for piece in pieces]
        self._join(space.entry, space.heading_rad)
        self._cells = {i for i, p in enumerate(pieces) if isinstance(p, Cell)}
        self._gain = np.array([float(piece.gain) for piece in pieces])
        self._area = np.array([piece.area for piece in pieces], int)
        self._entries = [(i, w) for i, ways in enumerate(self._ways) for w in range(len(ways))]
        lines = [self._ways[i][w] for i, w in self._entries]
        self._piece = np.array([i for i, _ in self._entries], int)
        self._begins = np.array([line[0] for line in lines]).reshape(-1, 2)
        self._first_rad = np.array([direction_rad(*line[:2]) for line in lines])
        self._later = np.array([i in self._cells for i in self._piece]) * later
        self._node = np.array([lattice.node_at(line[0]) for line in lines], int)

    def _join(self, at: np.ndarray, heading: float) -> None:
        """Let ways that begin beside the robot begin abreast of it: turning back costs more."""
        reach = _JOIN_M / self._space.cell_m
        ahead = np.array([math.cos(heading), math.sin(heading)])
        for ways in self._ways:
            for w, way in enumerate(ways):
                leg = way[1] - way[0]
                far = math.hypot(*leg)
                if far < 1.0 or math.hypot(*(way[0] - at)) > reach or leg @ ahead < 0.3 * far:
                    continue
                abreast = float((at - way[0]) @ leg) / far
                if 0.0 < abreast < far - 0.5:
                    ways[w] = np.vstack([way[0] + leg * (abreast / far), way[1:]])

    def lines(self, horizon: float) -> list[np.ndarray]:
        """Greedily up to the horizon; without one the whole tour, in a better order."""
        order = self._greedy(horizon)
        if math.isinf(horizon):
            entry, heading = self._space.entry, self._space.heading_rad
            order = improved(self._lattice, self._ways, entry, heading, order, self._turn)
        lines: list[np.ndarray] = []
        at = self._space.entry
        for piece, way in order:
            entry = self._ways[piece][way][0]
            approach = self._lattice.route(at, entry)
            if approach is None:
                continue
            line = self._driven(approach, self._ways[piece][way], piece in self._cells)
            line, horizon = _cut(line, horizon)
            lines.append(line)
            at = line[-1]
        return lines

    def _greedy(self, horizon: float) -> list[tuple[int, int]]:
        """Pieces and their ways, always the cheapest next, for about `horizon` cells of way."""
        at, heading = self._space.entry, self._space.heading_rad
        area = int(self._areas[int(at[1]), int(at[0])])
        left = np.ones(len(self._ways), bool)
        order: list[tuple[int, int]] = []
        while left.any() and horizon > 0.0:
            # An area is finished before the next is begun.
            here = left & (self._area == area)
            found = self._next(at, heading, here) or self._next(at, heading, left, trip=True)
            if found is None:
                break
            piece, way = found
            area = self._pieces[piece].area
            order.append(found)
            left[piece] = False
            line = self._ways[piece][way]
            horizon -= math.hypot(*(line[0] - at)) + float(np.hypot(*np.diff(line, axis=0).T).sum())
            at = line[-1]
            if len(line) > 1:
                heading = direction_rad(*line[-2:])
        return order

    def _next(
        self, at: np.ndarray, heading: float, left: np.ndarray, trip: bool = False
    ) -> tuple[int, int] | None:
        """The cheapest of the pieces `left` (bool) and its way; None: no way leads to any.

        The work must be worth the way: for a `trip` all that is to be done in its area, otherwise
        the piece alone.
        """
        ways = np.flatnonzero(left[self._piece])
        if len(ways) == 0:
            return None
        legs, first_rad = self._begins[ways] - at, self._first_rad[ways]
        far = np.hypot(legs[:, 0], legs[:, 1])
        extra = self._turn * turning_rad(legs, heading, first_rad) + self._later[ways]
        worth = self._worth(left, whole_areas=trip)[self._piece[ways]]
        source = self._lattice.node_at(at)
        for limit_m in _NEAR_M:  # mostly what is near is enough
            limit = limit_m / self._space.cell_m
            cost = np.maximum(self._lattice.costs(source, limit)[self._node[ways]], far)
            total = np.where(cost <= worth, cost + extra, np.inf)
            best = int(total.argmin())
            if total[best] <= limit:
                break
        return self._entries[ways[best]] if np.isfinite(total[best]) else None

    def _worth(self, left: np.ndarray, *, whole_areas: bool) -> np.ndarray:
        """How far, in cells, one may drive for each piece; `left` are still to be done."""
        gain = self._gain
        if whole_areas:
            gain = np.bincount(self._area, gain * left)[self._area]
        return gain * self._reward

    def _driven(self, approach: np.ndarray, way: np.ndarray, links: bool) -> np.ndarray:
        """Approach and way in one line; `links` between runs that are not clear go round."""
        points = list(approach[:-1])
        for k, p in enumerate(way):
            if links and k > 0 and k % 2 == 0 and not self._lattice.clear(way[k - 1], p):
                route = self._lattice.route(way[k - 1], p)
                if route is not None:
                    points += list(route[1:-1])
            points.append(p)
        return np.array(points)


def _cut(line: np.ndarray, horizon: float) -> tuple[np.ndarray, float]:
    """The line up to the first point beyond `horizon`, and what is left of the horizon."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    last = int(np.searchsorted(along, horizon))
    if last >= len(line):
        return line, horizon - float(along[-1])
    return line[: last + 1], 0.0


def _ways(piece: Chain | Cell) -> list[np.ndarray]:
    """The polylines by which a piece can be driven."""
    if isinstance(piece, Cell):
        forward, ways = piece.runs, []
        for runs in (forward, forward[::-1]):
            for first in (0, 1):
                ends = [run if (k + first) % 2 == 0 else run[::-1] for k, run in enumerate(runs)]
                line = np.vstack(ends)
                if len(runs) == 1 and np.allclose(line[0], line[1]):
                    line = np.vstack([line[0], line[0] + (0.5, 0.0)])
                ways.append(line)
        return ways if len(forward) > 1 else ways[:2]
    if not piece.closed:
        return [piece.points, piece.points[::-1]]
    ring = piece.points[:-1]
    length = np.hypot(*np.diff(piece.points, axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(length)])
    ways = []
    for mark in np.arange(0.0, along[-1], 16.0):
        i = int(np.searchsorted(along, mark))
        turned = np.roll(ring, -(i % len(ring)), axis=0)
        loop = np.vstack([turned, turned[:1]])
        ways += [loop, loop[::-1]]
    return ways
