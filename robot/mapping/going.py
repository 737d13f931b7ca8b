"""How hard floor is to cross: thick carpets, thresholds and cables, learned by driving over them.

Where wheels roll farther than the robot comes, a share of the way is lost. Each cell keeps the mean
of what was lost on it, the newest weighing most, so that a carpet which is gone is forgotten.
"""

from __future__ import annotations

import numpy as np

from robot.mapping.raster import Window, moved

LEAST_LOST = 0.3  # less is within the error of what wheels and eyes tell, and
LEAST_PCT = 30  # less, in the mean, was one slip and not the floor
_NEWEST = 0.5  # weight of what was lost now


class Going:
    """Percent lost in each cell, on the grid's lattice; 0 also where nobody has driven."""

    def __init__(self) -> None:
        self._window = Window(0, 0, 0, 0)
        self._lost_pct = np.zeros((0, 0), np.uint8)

    def follow(self, window: Window) -> None:
        """Cover `window`, which holds the present one."""
        self._lost_pct, self._window = moved(self._lost_pct, self._window, window), window

    def learn(self, window: Window, inside: np.ndarray, lost: float) -> None:
        """This share, 0 to 1, was lost on the cells of `inside` (bool, of the window's shape)."""
        part = self._lost_pct[self._window.slices(window)]
        now_pct = 100.0 * min(lost, 1.0) if lost >= LEAST_LOST else 0.0
        part[inside] = np.rint(part[inside] + _NEWEST * (now_pct - part[inside])).astype(np.uint8)

    def on(self, window: Window) -> np.ndarray:
        """Percent (uint8, of the shape of `window`); 0 where the floor is as good as any."""
        lost_pct = self.memory(window)
        return np.where(lost_pct >= LEAST_PCT, lost_pct, 0).astype(np.uint8)

    def memory(self, window: Window) -> np.ndarray:
        """All that is known, percent (uint8, of the shape of `window`)."""
        return moved(self._lost_pct, self._window, window)

    def restore(self, window: Window, lost_pct: np.ndarray) -> None:
        """Begin with a `memory` of this window."""
        self._window, self._lost_pct = window, lost_pct.astype(np.uint8)
