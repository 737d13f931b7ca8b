"""Grids that share one lattice: cell (0, 0) of the lattice has its corner at the world's origin.

Every map of a run (occupancy, swept floor) lies on this lattice, so that one is cut out of
another by whole cells however both have grown.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robot.messages import Grid

GROW_CELLS = 64


@dataclass(frozen=True, slots=True)
class Window:
    """Half-open box of lattice cells: columns [ix0, ix1), rows [iy0, iy1)."""

    ix0: int
    iy0: int
    ix1: int
    iy1: int

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""
        return self.iy1 - self.iy0, self.ix1 - self.ix0

    def union(self, other: Window) -> Window:
        """The smallest box around both."""
        return Window(
            min(self.ix0, other.ix0),
            min(self.iy0, other.iy0),
            max(self.ix1, other.ix1),
            max(self.iy1, other.iy1),
        )

    def contains(self, other: Window) -> bool:
        """True if `other` lies inside."""
        return self.union(other) == self

    def slices(self, inner: Window) -> tuple[slice, slice]:
        """Index of `inner` in an array that covers this box."""
        return (
            slice(inner.iy0 - self.iy0, inner.iy1 - self.iy0),
            slice(inner.ix0 - self.ix0, inner.ix1 - self.ix0),
        )

    def intersection(self, other: Window) -> Window:
        """The common box; empty boxes have no cells but keep their order."""
        ix0, iy0 = max(self.ix0, other.ix0), max(self.iy0, other.iy0)
        return Window(
            ix0, iy0, max(ix0, min(self.ix1, other.ix1)), max(iy0, min(self.iy1, other.iy1))
        )


def window_around(
    x_min_m: float, y_min_m: float, x_max_m: float, y_max_m: float, resolution_m: float
) -> Window:
    """All cells touched by a box given in metres, and one more on each side."""
    return Window(
        math.floor(x_min_m / resolution_m) - 1,
        math.floor(y_min_m / resolution_m) - 1,
        math.floor(x_max_m / resolution_m) + 2,
        math.floor(y_max_m / resolution_m) + 2,
    )


def window_of(grid: Grid) -> Window:
    """The cells of a grid on the lattice."""
    ix0, iy0 = (round(at / grid.resolution_m) for at in (grid.origin_x_m, grid.origin_y_m))
    rows, columns = grid.cells.shape
    return Window(ix0, iy0, ix0 + columns, iy0 + rows)


def grown(window: Window, wanted: Window) -> Window:
    """A box around both, with room to spare on the sides that had to move."""
    return Window(
        window.ix0 if wanted.ix0 >= window.ix0 else wanted.ix0 - GROW_CELLS,
        window.iy0 if wanted.iy0 >= window.iy0 else wanted.iy0 - GROW_CELLS,
        window.ix1 if wanted.ix1 <= window.ix1 else wanted.ix1 + GROW_CELLS,
        window.iy1 if wanted.iy1 <= window.iy1 else wanted.iy1 + GROW_CELLS,
    )


def moved(cells: np.ndarray, old: Window, new: Window) -> np.ndarray:
    """The same cells in an array that covers `new`; zeros elsewhere."""
    out = np.zeros(new.shape, cells.dtype)
    common = old.intersection(new)
    out[new.slices(common)] = cells[old.slices(common)]
    return out
