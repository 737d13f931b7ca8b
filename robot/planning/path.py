"""Routes: Dijkstra on a lattice of coarse nodes, then pulled straight on the fine clearance map.

The lattice has one node per block of about 0.1 m, at the block's roomiest reachable centre, and
edges where the straight line between two neighbours keeps the robot clear. (Dijkstra, Numerische
Mathematik 1959; string pulling as any-angle smoothing, Nash and Koenig, AI Magazine 2013.)
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from robot.planning.costmap import Space

if TYPE_CHECKING:
    from scipy.sparse import csr_array

_NODE_M = 0.10
_NEAR, _NEAR_BLOCKS = 6, 4  # nodes that a point may begin from, and where they are looked for
_AT_ONCE = 64  # sources, so that their rows of all nodes fit into a small memory
_STEPS = ((0, 1), (1, 0), (1, 1), (1, -1))


class Lattice:
    """Coarse graph over the reachable centres of a `Space`.

    Ways prefer `soft_clearance_m` of room, and floor that wheels lose nothing on: where all is lost
    by slip, a metre costs `slip_cost` more.
    """

    def __init__(self, space: Space, soft_clearance_m: float, slip_cost: float) -> None:
        self._space, self._slip_cost = space, slip_cost
        self.cell_m = space.cell_m
        self._block = max(1, round(_NODE_M / space.cell_m))
        self._soft_m = max(soft_clearance_m, space.need_m + 1e-3)
        self._tolerance_m = 0.5 * space.cell_m
        self.points, self._node_of_block = self._nodes()
        self._bends: dict[tuple[int, int], np.ndarray] = {}
        self._pairs = self._connect()
        self._both_ways: csr_array | None = None

    def clear(self, a: np.ndarray, b: np.ndarray, need_m: float | None = None) -> bool:
        """True if the robot can drive straight from `a` to `b` (cells)."""
        x, y = _line(a, b)
        need = self._space.need_m - self._tolerance_m if need_m is None else need_m
        room = self._space.clearance_m[y, x]
        # Whoever begins too near to matter may leave, but not come nearer.
        if not ((room >= need) | (room >= room[0]) & (room[0] < need)).all():
            return False
        return not self._space.unknown[y, x].any()

    def node_at(self, point: np.ndarray) -> int:
        """The nearest node, one in plain view of `point` if there is any among the nearest."""
        near = self._nearest(point)
        for node in near:
            if self.clear(point, self.points[node]):
                return int(node)
        return int(near[0])

    def _nearest(self, point: np.ndarray) -> np.ndarray:
        """The nearest nodes, at most `_NEAR`, in order: from the blocks around if they suffice."""
        number, reach = self._node_of_block, _NEAR_BLOCKS
        column, row = int(point[0]) // self._block, int(point[1]) // self._block
        part = number[max(0, row - reach) : row + reach + 1, max(0, column - reach) :]
        nodes = part[:, : column + reach + 1 - max(0, column - reach)].ravel()
        nodes, far = self._by_distance(nodes[nodes >= 0], point)
        if len(nodes) < _NEAR or far[_NEAR - 1] > (reach - 1) * self._block:
            nodes, _ = self._by_distance(np.arange(len(self.points)), point)
        return nodes[:_NEAR]

    def _by_distance(self, nodes: np.ndarray, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        far = np.hypot(self.points[nodes, 0] - point[0], self.points[nodes, 1] - point[1])
        order = np.argsort(far, kind="stable")
        return nodes[order], far[order]

    def costs(self, source: int, limit_cells: float = math.inf) -> np.ndarray:
        """Costs (n,) of the ways from one node to all; inf beyond a limit."""
        from scipy.sparse.csgraph import dijkstra

        found: np.ndarray = dijkstra(self._graph(), indices=source, limit=limit_cells)
        return found

    def _graph(self) -> csr_array:
        """All edges, there and back. Made when it is first needed."""
        if self._both_ways is None:
            from scipy.sparse import csr_array

            pair, cost = self._pairs
            index = np.concatenate([pair, pair[:, ::-1]]).T.astype(np.int32)
            size = len(self.points)
            self._both_ways = csr_array((np.tile(cost, 2), index), shape=(size, size))
        return self._both_ways

    def distances(self, sources: np.ndarray, targets: np.ndarray, limit_cells: float) -> np.ndarray:
        """Costs (len(sources), len(targets)) of ways between nodes; inf beyond a limit."""
        from scipy.sparse import csr_array
        from scipy.sparse.csgraph import dijkstra

        # A way that is short enough does not leave the box around its ends by more than half of it.
        ends = self.points[np.concatenate([sources, targets])]
        low, high = ends.min(axis=0) - limit_cells / 2.0, ends.max(axis=0) + limit_cells / 2.0
        inside = ((self.points >= low) & (self.points <= high)).all(axis=1)
        number = np.cumsum(inside) - 1
        pair, cost = self._pairs
        kept = inside[pair].all(axis=1)
        index = number[pair[kept]].T.astype(np.int32)
        size = int(np.count_nonzero(inside))
        graph = csr_array((cost[kept], index), shape=(size, size))
        parts = [
            dijkstra(graph, directed=False, indices=part, limit=limit_cells)[:, number[targets]]
            for part in np.array_split(number[sources], max(1, len(sources) // _AT_ONCE))
        ]
        return np.concatenate(parts)

    def route(self, start: np.ndarray, goal: np.ndarray) -> np.ndarray | None:
        """Waypoints (n, 2) in cells from `start` to `goal`, both included; None if cut off."""
        if self._straight(start, goal, np.array([start, goal])):
            return np.array([start, goal])
        nodes = self._way(self.node_at(start), self.node_at(goal))
        return self._pulled(start, nodes, goal) if nodes else None

    def _way(self, source: int, target: int) -> list[int]:
        """Nodes of the cheapest way; none if cut off."""
        from scipy.sparse.csgraph import dijkstra

        straight = math.hypot(*(self.points[target] - self.points[source]))
        for limit in (2.0 * straight, math.inf):  # mostly the detour is not great
            cost, before = dijkstra(
                self._graph(), indices=source, limit=limit, return_predecessors=True
            )
            if np.isfinite(cost[target]):
                break
        else:
            return []
        nodes = [target]
        while nodes[-1] != source:
            nodes.append(int(before[nodes[-1]]))
        return nodes[::-1]

    def _pulled(self, start: np.ndarray, nodes: list[int], goal: np.ndarray) -> np.ndarray:
        """The string from `start` along `nodes` to `goal`, pulled straight where there is room.

        A shortcut may come as near to matter as the nodes it replaces, or to a hand's breadth.
        """
        points = np.vstack([start[None], self._along(nodes), goal[None]])
        space = self._space
        cells = np.rint(points).astype(int)
        room = space.clearance_m[cells[:, 1], cells[:, 0]]
        least = space.need_m - self._tolerance_m
        kept, anchor, i = [points[0]], 0, 1
        while i < len(points) - 1:
            need = max(least, min(space.need_m + 0.05, float(room[anchor : i + 2].min())))
            if not self._straight(points[anchor], points[i + 1], points[anchor : i + 2], need):
                kept.append(points[i])
                anchor = i
            i += 1
        kept.append(points[-1])
        return np.array(kept)

    def _straight(
        self, a: np.ndarray, b: np.ndarray, instead: np.ndarray, need_m: float | None = None
    ) -> bool:
        """Whether a straight way may take the place of the points `instead` (n, 2)."""
        if not self.clear(a, b, need_m):
            return False
        (x, y), (at_x, at_y) = _line(a, b), np.rint(instead).astype(int).T
        lost = self._space.lost
        return bool(lost[y, x].max() <= lost[at_y, at_x].max())

    def _along(self, nodes: list[int]) -> np.ndarray:
        """The nodes' points, and the bends of edges that are not straight."""
        points = [self.points[nodes[0]]]
        for a, b in pairwise(nodes):
            bend = self._bends.get((min(a, b), max(a, b)))
            points += [self.points[b]] if bend is None else [bend, self.points[b]]
        return np.array(points)

    def _nodes(self) -> tuple[np.ndarray, np.ndarray]:
        """Points (n, 2) of the nodes, and the node's number (or -1) of each block."""
        space, b = self._space, self._block
        high, wide = space.drivable.shape
        rows, columns = -(-high // b), -(-wide // b)
        room = np.full((rows * b, columns * b), -1.0, np.float32)
        room[:high, :wide] = np.where(
            space.drivable, np.minimum(space.clearance_m, self._soft_m), -1
        )
        # Among equals the block's middle.
        offset = np.abs(np.arange(b) - (b - 1) / 2.0)
        tilt = np.float32(1e-4) * np.add.outer(offset, offset).astype(np.float32)
        blocks = room.reshape(rows, b, columns, b).transpose(0, 2, 1, 3) - tilt
        flat = blocks.reshape(rows, columns, b * b)
        best = flat.argmax(axis=2)
        valid = flat.max(axis=2) > 0.0
        y, x = np.nonzero(valid)
        inner = best[y, x]
        points = np.stack([x * b + inner % b, y * b + inner // b], axis=1).astype(float)
        number = np.full((rows, columns), -1, np.int64)
        number[y, x] = np.arange(len(x))
        return points, number

    def _connect(self) -> tuple[np.ndarray, np.ndarray]:
        """Pairs (n, 2) of neighbours and their costs (n,): length, dearer near matter."""
        space, number = self._space, self._node_of_block
        rows, columns = number.shape
        pairs = []
        for dy, dx in _STEPS:
            a = number[: rows - dy, max(0, -dx) : columns - max(0, dx)]
            b = number[dy:, max(0, dx) : columns + min(0, dx)]
            both = (a >= 0) & (b >= 0)
            pairs.append(np.stack([a[both], b[both]], axis=1))
        pair = np.vstack(pairs)
        p, q = self.points[pair[:, 0]], self.points[pair[:, 1]]
        t = np.linspace(0.0, 1.0, 2 * self._block + 1)[None, :]
        x = np.rint(p[:, :1] + (q - p)[:, :1] * t).astype(int)
        y = np.rint(p[:, 1:] + (q - p)[:, 1:] * t).astype(int)
        room = space.clearance_m[y, x].min(axis=1)
        good = (room >= space.need_m - self._tolerance_m) & ~space.unknown[y, x].any(axis=1)
        bent = self._bend(pair[~good])
        pair = np.vstack([pair[good], bent])
        room = np.concatenate([room[good], np.full(len(bent), space.need_m)])
        length = np.hypot(*(self.points[pair[:, 0]] - self.points[pair[:, 1]]).T)
        tight = np.clip((self._soft_m - room) / (self._soft_m - space.need_m), 0.0, 1.0)
        middle = np.rint(self.points[pair].mean(axis=1)).astype(int)
        lost = self._space.lost[middle[:, 1], middle[:, 0]]
        return pair, length * (1.0 + tight + self._slip_cost * lost)

    def _bend(self, pairs: np.ndarray) -> np.ndarray:
        """Those pairs of neighbours that touch although no straight line joins them."""
        b, drivable = self._block, self._space.drivable
        touching = []
        for i, j in pairs.tolist():
            x, y = (self.points[i] // b).astype(int) * b
            dx, dy = ((self.points[j] // b) - (self.points[i] // b)).astype(int)
            if dx and dy:
                continue
            ys = np.arange(y, min(y + b, drivable.shape[0])) if dx else np.array([y + b - 1])
            xs = np.arange(x, min(x + b, drivable.shape[1])) if dy else np.array([x + b - 1])
            ys, xs = np.broadcast_arrays(ys, xs)
            both = np.flatnonzero(drivable[ys, xs] & drivable[ys + dy, xs + dx])
            if len(both):
                middle = both[len(both) // 2]
                self._bends[min(i, j), max(i, j)] = np.array(
                    [xs[middle] + 0.5 * dx, ys[middle] + 0.5 * dy]
                )
                touching.append((i, j))
        return np.array(touching, np.int64).reshape(-1, 2)


def _line(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Columns and rows of the cells on the straight line between two points."""
    n = max(2, int(math.hypot(b[0] - a[0], b[1] - a[1]) * 1.5) + 2)
    x, y = (np.rint(np.linspace(a[i], b[i], n)).astype(int) for i in (0, 1))
    return x, y
