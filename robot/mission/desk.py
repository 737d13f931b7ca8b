"""Where plans are ordered and their answers wait: one question at a time.

What people have forbidden is matter for the planner, with a margin for the error of the place.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np

from robot.geometry.se2 import SE2
from robot.mapping.grid import OccupancyGrid
from robot.mapping.keepout import forbid
from robot.mapping.notes import MapNotes
from robot.mapping.swept import SweptFloor
from robot.messages import Command, Grid, Planned, PlanOrder


class PlanDesk:
    """Numbers the orders and keeps only the answer to the newest one."""

    def __init__(
        self,
        grid: OccupancyGrid,
        swept: SweptFloor,
        notes: MapNotes | None = None,
        margin_m: float = 0.0,
    ) -> None:
        self._grid = grid
        self._swept = swept
        self._notes = notes or MapNotes()
        self._margin_m = margin_m
        self._order_id = 0
        self._asked_ns = 0
        self._waiting = False
        self._answer: Planned | None = None
        self.known_free_m2 = 0.0  # of the newest order's grid

    @property
    def waiting(self) -> bool:
        """Whether an answer is still to come."""
        return self._waiting

    def waited_s(self, now_ns: int) -> float:
        """How long the open order has been waiting, 0 without one."""
        return (now_ns - self._asked_ns) * 1e-9 if self._waiting else 0.0

    def order(
        self,
        t_ns: int,
        kind: Literal["coverage", "route"],
        start: SE2,
        orders: list[Command],
        goal: SE2 | None = None,
        area: Callable[[Grid], np.ndarray] | None = None,
    ) -> None:
        """Ask; an earlier question is forgotten. The command is added to `orders`.

        `area` tells which cells (bool, of the grid's shape) the work is about, None: all.
        """
        grid = self._grid.snapshot()
        self.known_free_m2 = free_area_m2(grid.cells, grid.resolution_m)
        self._order_id += 1
        self._asked_ns = t_ns
        self._waiting, self._answer = True, None
        covered = self._swept.on(grid)
        if area is not None:
            covered = covered | ~area(grid)
        lost_pct = self._grid.lost_pct(grid)
        grid = forbid(grid, self._notes.current, self._margin_m)
        orders.append(
            PlanOrder(
                t_ns,
                self._order_id,
                kind,
                grid,
                covered,
                start,
                goal,
                explore=area is None,
                lost_pct=lost_pct if lost_pct.any() else None,
            )
        )

    def planned(self, answer: Planned) -> None:
        """Take an answer in; one to an older order is dropped."""
        if self._waiting and answer.order_id == self._order_id:
            self._waiting, self._answer = False, answer

    def take(self) -> Planned | None:
        """The answer, once."""
        answer, self._answer = self._answer, None
        return answer

    def drop(self) -> None:
        """Forget question and answer: the robot does something else now."""
        self._waiting, self._answer = False, None


def free_area_m2(cells: np.ndarray, resolution_m: float) -> float:
    """Area of the free cells of a grid."""
    return float(np.count_nonzero(cells == 0)) * resolution_m**2
