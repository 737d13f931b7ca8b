"""Where to look next: reachable places from which unseen, perhaps reachable floor begins.

A frontier counts only if the robot could stand behind it were the unknown free (Yamauchi,
CIRA 1997, restricted to the robot's own size), so slits behind furniture call nobody.
"""

from __future__ import annotations

import cv2
import numpy as np

from robot.planning.costmap import Space, disc
from robot.planning.path import Lattice

_LOOK_BACK_M = 0.45  # the last leg is at least this long, so that the camera faces the unseen


def unseen(space: Space, min_unseen_m2: float) -> tuple[np.ndarray, int]:
    """Labels (0: none) of unseen places where the robot might stand, and their count plus one."""
    dim = cv2.dilate(space.unknown.astype(np.uint8), disc(space.shy_m / space.cell_m + 1.0)) > 0
    hidden = ((space.clearance_m >= space.need_m) & dim & ~space.drivable).astype(np.uint8)
    count, labels, _stats, _ = cv2.connectedComponentsWithStats(hidden, connectivity=4)
    near = cv2.dilate(space.drivable.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool)
    touching = np.unique(labels[near & (labels > 0)])
    unknown = np.bincount(labels[space.unknown], minlength=count)
    keep = np.zeros(count, bool)
    keep[touching] = True
    keep &= unknown * space.cell_m**2 >= min_unseen_m2
    keep[0] = False
    number = np.cumsum(keep) * keep
    return number[labels], int(keep.sum()) + 1


def look_route(
    space: Space, lattice: Lattice, at: np.ndarray, min_unseen_m2: float
) -> np.ndarray | None:
    """Waypoints (cells) to the frontier nearest by route, ending face to it; None: all seen."""
    labels, count = unseen(space, min_unseen_m2)
    if count == 1:
        return None
    border = cv2.dilate((labels > 0).astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool)
    ys, xs = np.nonzero(border & space.drivable)
    if len(xs) == 0:
        return None
    points = np.stack([xs, ys], axis=1).astype(float)
    points = points[:: max(1, len(points) // 400)]
    cost = lattice.costs(lattice.node_at(at))[[lattice.node_at(point) for point in points]]
    nearest = int(cost.argmin())
    route = lattice.route(at, points[nearest]) if np.isfinite(cost[nearest]) else None
    return None if route is None else _facing(space, lattice, route, labels)


def _facing(space: Space, lattice: Lattice, route: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """Make the last leg of `route` long enough and point at the unseen floor beside its end."""
    goal = route[-1]
    back = _LOOK_BACK_M / space.cell_m
    x, y = int(goal[0]), int(goal[1])
    r = int(back)
    part = labels[max(0, y - r) : y + r + 1, max(0, x - r) : x + r + 1]
    ys, xs = np.nonzero(part)
    if len(xs) == 0:
        return route
    middle = np.array([xs.mean() + max(0, x - r), ys.mean() + max(0, y - r)])
    ahead = middle - goal
    if np.hypot(*ahead) < 0.5:
        return route
    ahead /= np.hypot(*ahead)
    leg = goal - route[-2] if len(route) > 1 else np.zeros(2)
    far = np.hypot(*leg)
    if far >= back and float(leg @ ahead) / far > 0.6:
        return route
    best, best_score = None, -np.inf
    for angle in np.linspace(-1.2, 1.2, 9):
        c, s = np.cos(angle), np.sin(angle)
        way = np.array([c * ahead[0] - s * ahead[1], s * ahead[0] + c * ahead[1]])
        behind = goal - way * back
        if not _inside(space, behind) or not lattice.clear(behind, goal):
            continue
        score = c - 0.3 * np.hypot(*(behind - route[0])) / (back + np.hypot(*(goal - route[0])))
        if score > best_score:
            best, best_score = behind, score
    if best is None:
        return route
    detour = lattice.route(route[0], best)
    return route if detour is None else np.vstack([detour, goal[None]])


def _inside(space: Space, point: np.ndarray) -> bool:
    x, y = round(point[0]), round(point[1])
    high, wide = space.drivable.shape
    return 0 <= x < wide and 0 <= y < high and bool(space.drivable[y, x])
