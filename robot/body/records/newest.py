"""Numbers of a life that may last for months: the newest of them, packed."""

from __future__ import annotations

from array import array

import numpy as np


class Newest:
    """Rows of `width` numbers; of more than twice `most` the older half is forgotten."""

    def __init__(self, width: int, most: int) -> None:
        self._width, self._most = width, most
        self._numbers = array("d")

    def append(self, *row: float) -> None:
        """One more row."""
        self._numbers.extend(row)
        if len(self) >= 2 * self._most:
            del self._numbers[: self._most * self._width]

    def __len__(self) -> int:
        return len(self._numbers) // self._width

    @property
    def rows(self) -> np.ndarray:
        """A copy (n, width), oldest first."""
        return np.array(self._numbers).reshape(-1, self._width)
