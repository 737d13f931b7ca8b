"""What a run is about: the whole home, some rooms, some rectangles, or the spot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from robot.geometry.se2 import SE2
from robot.mapping.annotations import Area
from robot.mapping.keepout import areas_mask
from robot.mapping.named_rooms import Rooms
from robot.messages import Grid

JobKind = Literal["clean", "spot", "zone", "room"]


@dataclass(frozen=True, slots=True, eq=False)
class Job:
    """`kind` is also the name of the state that does it. `what` is for people."""

    kind: JobKind = "clean"
    what: str = "the whole home"
    areas: tuple[Area, ...] = ()
    rooms: Rooms | None = None
    numbers: tuple[int, ...] = ()

    def area(self, grid: Grid) -> np.ndarray:
        """Bool array of the grid's shape: the cells to be swept."""
        if self.rooms is not None:
            return self.rooms.on(grid, self.numbers)
        return areas_mask(grid, self.areas)

    @property
    def whole(self) -> bool:
        """Whether it is about all floor that can be reached."""
        return self.rooms is None and not self.areas


def spot_job(place: SE2, side_m: float) -> Job:
    """A square around the robot, along its heading."""
    half = side_m / 2.0
    corners = place.apply(np.array([[-half, -half], [half, -half], [half, half], [-half, half]]))
    points = tuple((float(x), float(y)) for x, y in corners)
    return Job("spot", f"a spot of {side_m:.1f} m", (Area("spot", points),))


def zone_job(areas: Sequence[Area]) -> Job:
    """Areas with names, or rectangles that were just given."""
    return Job("zone", ", ".join(area.name for area in areas), tuple(areas))


def room_job(rooms: Rooms, names: tuple[str, ...]) -> Job:
    """Rooms by name. Raises MapError for an unknown one."""
    numbers = tuple(rooms.number(name) for name in names)
    return Job("room", ", ".join(rooms.names[n - 1] for n in numbers), (), rooms, numbers)
