"""Which parts of the image the board has been in, shown as text."""

from __future__ import annotations

import numpy as np

from robot.calibrate.board import Found

COLUMNS, ROWS = 8, 6
ENOUGH = 0.6  # of the cells


class Coverage:
    """Counts corners in a coarse grid over one eye's image."""

    def __init__(self, size_px: tuple[int, int]) -> None:
        self._size = np.asarray(size_px, dtype=float)
        self.counts = np.zeros((ROWS, COLUMNS), int)

    def add(self, found: Found) -> None:
        """Enter the corners of one picture."""
        cells = (found.pixel / self._size * (COLUMNS, ROWS)).astype(int)
        inside = np.all((cells >= 0) & (cells < (COLUMNS, ROWS)), axis=1)
        np.add.at(self.counts, (cells[inside, 1], cells[inside, 0]), 1)

    @property
    def share(self) -> float:
        """Share of cells in which a corner has been."""
        return float((self.counts > 0).mean())

    def picture(self) -> str:
        """The image as text: `#` often, `+` seldom, `.` never."""
        marks = np.where(self.counts >= 10, "#", np.where(self.counts > 0, "+", "."))
        return "\n".join("".join(row) for row in marks)

    def advice(self) -> str:
        """Where to hold the board next; empty when enough is covered."""
        if self.share >= ENOUGH:
            return ""
        halves = {
            "left": self.counts[:, : COLUMNS // 2],
            "right": self.counts[:, COLUMNS // 2 :],
            "top": self.counts[: ROWS // 2],
            "bottom": self.counts[ROWS // 2 :],
        }
        emptiest = min(halves, key=lambda side: (halves[side] > 0).mean())
        return f"hold the board farther to the {emptiest}"
