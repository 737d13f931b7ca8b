"""The planning worker: one order in, one answer out. It keeps nothing between two orders."""

from __future__ import annotations

import numpy as np

from robot.config import PlanningConfig, RobotConfig
from robot.messages import Path, Planned, PlanOrder
from robot.planning.costmap import build_space
from robot.planning.coverage import plan_coverage
from robot.planning.path import Lattice


def plan(order: PlanOrder, planning: PlanningConfig, robot: RobotConfig) -> Planned:
    """Answer a "coverage" or a "route" order; the first waypoint is the order's start.

    An empty path means that there is nothing to do (coverage) or no way (route); `reason` says so.
    """
    space = build_space(order.grid, order.covered, order.start, planning, robot)
    if space is None:
        return _answer(order, np.zeros((0, 2)), 0.0, "the robot fits nowhere near its place")
    if order.kind == "route":
        return _route(order, planning, robot)
    found = plan_coverage(space, planning, robot)
    return _answer(order, space.to_world(found.points), found.remaining_m2, found.reason)


def _route(order: PlanOrder, planning: PlanningConfig, robot: RobotConfig) -> Planned:
    space = build_space(order.grid, order.covered, order.start, planning, robot)
    if space is None or order.goal is None:
        return _answer(order, np.zeros((0, 2)), 0.0, "no goal given")
    goal = space.to_plan(np.array([[order.goal.x_m, order.goal.y_m]]))[0]
    lattice = Lattice(space, planning.soft_clearance_m)
    near = lattice.points[lattice.node_at(space.entry)]
    points = lattice.route(near, goal)
    if points is None:
        return _answer(order, np.zeros((0, 2)), 0.0, "no way to the goal")
    return _answer(order, space.to_world(np.vstack([space.start[None], points])), 0.0, "route")


def _answer(order: PlanOrder, points_m: np.ndarray, remaining_m2: float, reason: str) -> Planned:
    return Planned(order.t_ns, order.order_id, Path(points_m), remaining_m2, reason)
