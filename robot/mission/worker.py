"""The worker's whole work: one `PlanOrder` in, one `Planned` out. It keeps nothing between two."""

from __future__ import annotations

import numpy as np

from robot.config import PlanningConfig, RobotConfig
from robot.mapping.rooms import segment_rooms
from robot.messages import Path, Planned, PlanOrder
from robot.planning.worker import plan

MAX_ROOMS = 255


def make_answer(order: PlanOrder, planning: PlanningConfig, robot: RobotConfig) -> Planned:
    """A path, as `robot.planning.worker.plan` makes it, or the rooms of the order's grid."""
    if order.kind != "rooms":
        return plan(order, planning, robot)
    rooms = segment_rooms(order.grid)
    rooms = np.where(rooms <= MAX_ROOMS, rooms, 0).astype(np.uint8)
    reason = f"{int(rooms.max(initial=0))} rooms"
    return Planned(order.t_ns, order.order_id, Path(np.zeros((0, 2))), 0.0, reason, rooms)
