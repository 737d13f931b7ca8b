"""Breadcrumbs: where the robot has come in, it can go out, whatever the map believes."""

from __future__ import annotations

from collections import deque

import numpy as np

from robot.geometry.se2 import SE2

EVERY_M = 0.05
KEEP = 200


class Trail:
    """The way driven lately, in odom."""

    def __init__(self) -> None:
        self._crumbs: deque[SE2] = deque(maxlen=KEEP)

    def __len__(self) -> int:
        return len(self._crumbs)

    def drop_crumb(self, odom_from_base: SE2) -> None:
        """Remember a place, unless one is near: after that one it only went about in a loop."""
        if self._crumbs and self._crumbs[-1].distance_m(odom_from_base) < EVERY_M:
            return
        near = [crumb.distance_m(odom_from_base) < EVERY_M for crumb in self._crumbs]
        if any(near):
            for _ in near[near.index(True) + 1 :]:
                self._crumbs.pop()
        else:
            self._crumbs.append(odom_from_base)

    def back(self, distance_m: float) -> np.ndarray:
        """Points (n, 2) of odom from the newest crumb back over `distance_m`."""
        count = 1 + round(distance_m / EVERY_M)
        crumbs = list(self._crumbs)[::-1][:count]
        return np.array([(c.x_m, c.y_m) for c in crumbs]).reshape(-1, 2)

    def cut(self, distance_m: float) -> None:
        """Forget what `back` has given: it has been gone back."""
        for _ in range(min(len(self._crumbs), round(distance_m / EVERY_M))):
            self._crumbs.pop()
