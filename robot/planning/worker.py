"""The planning worker: one order in, one answer out. It keeps nothing between two orders."""

from __future__ import annotations

import math

import numpy as np
from msgspec import structs

from robot.config import PlanningConfig, RobotConfig
from robot.geometry.se2 import SE2
from robot.messages import Path, Planned, PlanOrder
from robot.planning.costmap import Space, build_space
from robot.planning.coverage import CoveragePlan, plan_coverage
from robot.planning.path import Lattice

_NOWHERE = np.zeros((0, 2))
_NEAR_GOAL_M = 0.30  # a goal where the robot does not fit is approached as near as this


def plan(order: PlanOrder, planning: PlanningConfig, robot: RobotConfig) -> Planned:
    """Answer a "coverage" or a "route" order; a path begins at the order's start.

    An empty path means that there is nothing to do (coverage) or no way (route); `reason` says so.
    `remaining_m2` is the known reachable floor that is not swept yet, for both kinds.
    """
    space = build_space(order.grid, order.covered, order.start, planning, robot, order.lost_pct)
    if space is None:
        found = CoveragePlan(_NOWHERE, 0.0, "the robot fits nowhere near its place")
        return _answer(order, _NOWHERE, found, 0.0)
    if not order.explore:
        planning = structs.replace(planning, min_unseen_m2=math.inf)
    if order.kind == "coverage":
        found = plan_coverage(space, planning, robot)
    elif order.goal is None:
        found = CoveragePlan(_NOWHERE, 0.0, "no goal was given")
    else:
        found = _route(space, order.goal, planning)
    reached_m2 = space.area_m2(space.floor & ~space.uncovered)
    return _answer(order, space.to_world(found.points), found, reached_m2)


def _route(space: Space, goal: SE2, planning: PlanningConfig) -> CoveragePlan:
    """From the robot to the goal, or to the nearest place to it where the robot fits."""
    remaining_m2 = space.area_m2(space.uncovered)
    wanted = space.to_plan(np.array([[goal.x_m, goal.y_m]]))[0]
    target = _nearest_place(space, wanted)
    if target is None:
        return CoveragePlan(_NOWHERE, remaining_m2, "the goal cannot be reached on known floor")
    lattice = Lattice(space, planning.soft_clearance_m, planning.slip_cost)
    points = lattice.route(space.entry, target)
    if points is None:
        return CoveragePlan(_NOWHERE, remaining_m2, "no way leads to the goal")
    points = np.vstack([space.start[None], points])
    far = np.hypot(*np.diff(points, axis=0).T)
    return CoveragePlan(points[np.append(True, far > 1e-6)], remaining_m2, "route to the goal")


def _nearest_place(space: Space, wanted: np.ndarray) -> np.ndarray | None:
    """The goal itself if the robot fits there, else the nearest drivable cell close to it."""
    high, wide = space.drivable.shape
    x, y = (round(float(v)) for v in wanted)
    if 0 <= x < wide and 0 <= y < high and space.drivable[y, x]:
        return wanted
    ys, xs = np.nonzero(space.drivable)
    far = np.hypot(xs - wanted[0], ys - wanted[1])
    best = int(far.argmin())
    if far[best] * space.cell_m > _NEAR_GOAL_M:
        return None
    return np.array([xs[best], ys[best]], float)


def _answer(
    order: PlanOrder, points_m: np.ndarray, found: CoveragePlan, reached_m2: float
) -> Planned:
    remaining_m2, reason = found.remaining_m2, found.reason
    path = Path(points_m)
    return Planned(order.t_ns, order.order_id, path, remaining_m2, reason, reached_m2=reached_m2)
