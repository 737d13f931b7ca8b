"""A better order of pieces of work: the shortest open tour through all of them, from the robot on.

Each piece can be driven in some ways, each way from one end to another. Starting from any order,
stretches of the tour are turned round (2-opt; Croes, Operations Research 1958) or moved elsewhere
(Or-opt; Or, 1976) as long as that saves travel. Distances are those of the lattice, and turning
costs, too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from robot.planning.path import Lattice

Visit = tuple[int, int]  # piece, way

_MOVED = 4  # longest stretch that is moved
_ROUNDS = 12
_SAVING_CELLS = 0.5  # less is not worth another plan
_TOGETHER = 40  # so many visits are put into order at a time, so that time grows with the floor
_WAYS = 12  # beginnings that are tried of a closed edge
_BESIDE = 4.0  # cells; nearer, the robot turns to the way at once
_FAR_M, _DETOUR = 8.0, 2.0  # ways longer than this are guessed from the straight line


def improved(
    lattice: Lattice,
    ways: Sequence[Sequence[np.ndarray]],
    start: np.ndarray,
    heading_rad: float,
    order: list[Visit],
    turn_cells_per_rad: float,
) -> list[Visit]:
    """The same visits in a shorter order; `ways[piece][way]` is a polyline (n, 2) in cells."""
    better: list[Visit] = []
    for first in range(0, len(order), _TOGETHER):
        some = order[first : first + _TOGETHER]
        part = _Search(lattice, ways, start, heading_rad, some, turn_cells_per_rad).run()
        better += part
        piece, way = part[-1]
        start, heading_rad = ways[piece][way][-1], direction_rad(*ways[piece][way][-2:])
    return better


def direction_rad(begin: np.ndarray, end: np.ndarray) -> float:
    """Heading of the leg between two points."""
    return math.atan2(end[1] - begin[1], end[0] - begin[0])


def turning_rad(
    legs: np.ndarray, heading_rad: np.ndarray | float, first_rad: np.ndarray
) -> np.ndarray:
    """All turning on a way along `legs` (..., 2) in cells, between two headings."""
    far = np.hypot(legs[..., 0], legs[..., 1]) > _BESIDE
    along_rad = np.where(far, np.arctan2(legs[..., 1], legs[..., 0]), first_rad)
    return _turned(along_rad - heading_rad) + _turned(first_rad - along_rad)


def _turned(angle: np.ndarray) -> np.ndarray:
    return np.abs((angle + math.pi) % (2.0 * math.pi) - math.pi)


class _Search:
    """Visits are numbered by way: `tour` holds numbers of ways, and `_back` turns a way round."""

    def __init__(
        self,
        lattice: Lattice,
        ways: Sequence[Sequence[np.ndarray]],
        start: np.ndarray,
        heading_rad: float,
        order: list[Visit],
        turn_cells_per_rad: float,
    ) -> None:
        self._visits = [(p, w) for p, now in order for w in _some(ways[p], now)]
        number = {visit: k for k, visit in enumerate(self._visits)}
        self._others: dict[int, list[int]] = {}
        for p, w in self._visits:
            self._others.setdefault(p, []).append(number[p, w])
        self._back = [
            number[p, _reverse(ways[p], [self._visits[k][1] for k in self._others[p]], w)]
            for p, w in self._visits
        ]
        lines = [ways[p][w] for p, w in self._visits]
        first = np.array([line[0] for line in lines])
        last = np.array([line[-1] for line in lines])
        # Row 0 is the robot, row k + 1 the end of way k; columns are beginnings, the last none.
        ends = np.vstack([start[None], last])
        end_rad = np.array([heading_rad, *(direction_rad(*line[-2:]) for line in lines)])
        first_rad = np.array([direction_rad(*line[:2]) for line in lines])
        turning = turning_rad(first - ends[:, None], end_rad[:, None], first_rad)
        far = _distances(lattice, ends, first) + turn_cells_per_rad * turning
        self._far = np.pad(far, ((0, 0), (0, 1)))
        self._steps: list[list[float]] = self._far.tolist()  # faster to read one by one
        self.tour = [number[visit] for visit in order]

    def run(self) -> list[Visit]:
        for _ in range(_ROUNDS):
            if not (self._move_stretches() or self._turn_stretches() or self._choose_ways()):
                break
        return [self._visits[k] for k in self.tour]

    # ------------------------------------------------------------------ moves

    def _step(self, before: int, after: int) -> float:
        """Travel from the end of a way (-1: the robot) to the beginning of another (-1: none)."""
        return self._steps[before + 1][after]

    def _at(self, i: int) -> int:
        return self.tour[i] if 0 <= i < len(self.tour) else -1

    def _turned(self, stretch: list[int]) -> list[int]:
        return [self._back[k] for k in reversed(stretch)]

    def _turn_stretches(self) -> bool:
        """Turn tour[i:j] round wherever that is shorter. Travel inside stays what it was."""
        better, n = False, len(self.tour)
        for i in range(n):
            for j in range(i + 1, n + 1):
                before, first, last = self._at(i - 1), self.tour[i], self.tour[j - 1]
                after = self._at(j)
                now = self._step(before, first) + self._step(last, after)
                new = self._step(before, self._back[last]) + self._step(self._back[first], after)
                if new < now - _SAVING_CELLS:
                    self.tour[i:j] = self._turned(self.tour[i:j])
                    better = True
        return better

    def _move_stretches(self) -> bool:
        better = False
        for size in range(1, _MOVED + 1):
            i = 0
            while i + size <= len(self.tour):
                better |= self._move(i, size)
                i += 1
        return better

    def _move(self, i: int, size: int) -> bool:
        """Take tour[i:i+size] out and put it where it costs least, turned round if that helps."""
        stretch, rest = self.tour[i : i + size], self.tour[:i] + self.tour[i + size :]
        before, after = self._at(i - 1), self._at(i + size)
        saved = self._step(before, stretch[0]) + self._step(stretch[-1], after)
        saved -= self._step(before, after)
        if saved <= _SAVING_CELLS:
            return False
        a, b = np.array([-1, *rest]) + 1, np.array([*rest, -1])
        both = (stretch, self._turned(stretch))
        begin, end = (np.array([c[at] for c in both])[:, None] for at in (0, -1))
        cost = self._far[a, begin] + self._far[end + 1, b] - self._far[a, b]
        cost[0, i] = np.inf  # where it was
        turned, place = divmod(int(cost.argmin()), len(a))
        if cost[turned, place] >= saved - _SAVING_CELLS:
            return False
        self.tour = rest[:place] + both[turned] + rest[place:]
        return True

    def _choose_ways(self) -> bool:
        better = False
        for i, k in enumerate(self.tour):
            before, after = self._at(i - 1), self._at(i + 1)
            ways = self._others[self._visits[k][0]]
            best = min(ways, key=lambda w: (self._step(before, w) + self._step(w, after), w))
            now = self._step(before, k) + self._step(k, after)
            if self._step(before, best) + self._step(best, after) < now - _SAVING_CELLS:
                self.tour[i] = best
                better = True
        return better


def _some(ways: Sequence[np.ndarray], now: int) -> list[int]:
    """Not too many of a piece's ways, evenly spread, with their reverses and the present one.

    A closed edge has two ways, to and fro, for each place where it may begin.
    """
    pairs = max(1, len(ways) // 2)
    if pairs <= _WAYS or len(ways) % 2:
        return list(range(len(ways)))
    chosen = {now // 2, *(k * pairs // _WAYS for k in range(_WAYS))}
    return [w for k in sorted(chosen) for w in (2 * k, 2 * k + 1)]


def _reverse(ways: Sequence[np.ndarray], among: Sequence[int], w: int) -> int:
    """The way of the same piece that ends where way `w` begins, and begins where it ends."""
    return min(
        among,
        key=lambda k: (
            float(np.abs(ways[k][0] - ways[w][-1]).sum() + np.abs(ways[k][-1] - ways[w][0]).sum()),
            k == w,
        ),
    )


def _distances(lattice: Lattice, ends: np.ndarray, begins: np.ndarray) -> np.ndarray:
    """Travel (len(ends), len(begins)) in cells along the lattice; far ways are guessed."""
    straight = np.hypot(*(ends[:, None] - begins[None]).transpose(2, 0, 1))
    sources, row = np.unique([lattice.node_at(p) for p in ends], return_inverse=True)
    targets = np.array([lattice.node_at(p) for p in begins])
    along = lattice.distances(sources, targets, _FAR_M / lattice.cell_m)[row]
    return np.where(np.isfinite(along), np.maximum(along, straight), _DETOUR * straight)
