"""Coverage: edges first, lanes inside them, leftovers, and at last a look at what is unseen.

Nothing is remembered between two plans. Work is what the brush has not swept of the floor that is
known and reachable now, so a plan goes on where the last one stopped.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from robot.config import PlanningConfig, RobotConfig
from robot.planning.areas import label_areas
from robot.planning.costmap import Space, opened
from robot.planning.edges import Chain, edge_chains, paint
from robot.planning.frontier import look_route, unseen
from robot.planning.lanes import Cell, lane_cells, lane_rules
from robot.planning.path import Lattice
from robot.planning.tour import tour


@dataclass(frozen=True, slots=True, eq=False)
class CoveragePlan:
    """Waypoints (n, 2) in cells, the area left to sweep, and what the plan is about."""

    points: np.ndarray
    remaining_m2: float
    reason: str


def plan_coverage(space: Space, planning: PlanningConfig, robot: RobotConfig) -> CoveragePlan:
    """The whole work that is known, in order. No points: nothing is left to do."""
    todo = worthwhile(space, space.uncovered, planning)
    remaining_m2 = space.area_m2(todo)
    lattice = Lattice(space, planning.soft_clearance_m, planning.slip_cost)
    areas = label_areas(space)
    pieces = work_pieces(space, todo, areas, planning, robot) if remaining_m2 > 0.0 else []
    # While there is more to see the map will change: then the far end of a plan is of no use.
    growing = planning.horizon_m > 0.0 and unseen(space, planning.min_unseen_m2)[1] > 1
    horizon = planning.horizon_m / space.cell_m if growing else np.inf
    lines = tour(space, lattice, pieces, areas, planning, horizon)
    reason = f"sweep {remaining_m2:.1f} m2"
    at = lines[-1][-1] if lines else space.entry
    whole = len(lines) == len(pieces)
    look = look_route(space, lattice, at, planning.min_unseen_m2) if whole else None
    if look is not None:
        reason = reason + " and look" if lines else "look at unseen floor"
        lines.append(look)
    if not lines:
        return CoveragePlan(np.zeros((0, 2)), remaining_m2, "all known floor is swept")
    points = np.vstack([space.start[None], *lines])
    far = np.hypot(*np.diff(points, axis=0).T)
    return CoveragePlan(points[np.append(True, far > 0.2)], remaining_m2, reason)


def worthwhile(space: Space, mask: np.ndarray, planning: PlanningConfig) -> np.ndarray:
    """`mask` without slivers and specks that are not worth a trip."""
    size = max(1, round(planning.min_sliver_m / space.cell_m))
    out: np.ndarray = mask.astype(np.uint8)
    if size > 1:
        out = opened(out, np.ones((size, size), np.uint8))
    _, labels, stats, _ = cv2.connectedComponentsWithStats(out, connectivity=8)
    keep = stats[:, cv2.CC_STAT_AREA] * space.cell_m**2 >= planning.min_patch_m2
    keep[0] = False
    return keep[labels]


def work_pieces(
    space: Space,
    todo: np.ndarray,
    areas: np.ndarray,
    planning: PlanningConfig,
    robot: RobotConfig,
) -> list[Chain | Cell]:
    """Edge chains, the cells of lanes inside them, and short lanes over what both leave."""
    chains, inside = edge_chains(space, todo, areas, robot.brush_width_m)
    rules = lane_rules(space, planning, robot.brush_width_m)
    pieces: list[Chain | Cell] = list(chains)
    left = worthwhile(space, inside, planning)
    for _ in range(2):
        if not left.any():
            break
        cells = lane_cells(space, left, areas, rules)
        pieces += cells
        mask = left.astype(np.uint8)
        for cell in cells:
            for run in cell.runs:
                paint(mask, run, rules.brush)
        left = worthwhile(space, mask > 0, planning)
    return pieces
