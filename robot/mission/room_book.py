"""The rooms of the map, found by the worker when somebody asks, and remembered for a while."""

from __future__ import annotations

from robot.mapping.grid import OccupancyGrid
from robot.mapping.named_rooms import Rooms, make_rooms
from robot.mapping.notes import MapNotes
from robot.messages import Command, Grid, Planned, PlanOrder
from robot.mission.state import Situation, seconds

FRESH_S = 30.0  # the map may have grown since
PATIENCE_S = 5.0


class RoomBook:
    """One question to the worker at a time; its orders have negative numbers."""

    def __init__(self, grid: OccupancyGrid, notes: MapNotes) -> None:
        self._grid, self._notes = grid, notes
        self._order_id = 0
        self._asked: tuple[int, Grid] | None = None
        self._found: tuple[int, Grid, Planned] | None = None
        self._made: tuple[int, int, Rooms] | None = None  # order, version of the notes

    def planned(self, answer: Planned) -> bool:
        """Take an answer in; False where it is not one to this book."""
        if answer.order_id >= 0:
            return False
        if self._asked is not None and answer.order_id == self._order_id:
            self._found, self._asked = (answer.t_ns, self._asked[1], answer), None
        return True

    def rooms(self, now: Situation) -> Rooms | None:
        """The rooms as they are now; None while the worker is busy with them."""
        found = self._found
        if found is None or seconds(found[0], now.t_ns) > FRESH_S:
            self._ask(now.t_ns, now)
            return None
        order_id, version = found[2].order_id, self._notes.version
        if self._made is None or self._made[:2] != (order_id, version):
            labels = found[2].rooms
            assert labels is not None
            rooms = make_rooms(found[1], labels, self._notes.current)
            self._made = (order_id, version, rooms)
        return self._made[2]

    def _ask(self, t_ns: int, now: Situation) -> None:
        if self._asked is not None and seconds(self._asked[0], t_ns) < PATIENCE_S:
            return
        grid = self._grid.snapshot()
        self._order_id -= 1
        self._asked = (t_ns, grid)
        nothing = grid.cells < -1
        order: Command = PlanOrder(t_ns, self._order_id, "rooms", grid, nothing, now.pose)
        now.orders.append(order)
