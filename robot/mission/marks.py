"""What a touch or an edge tells the map: where it was met, so that the next plan avoids it."""

from __future__ import annotations

import math

import numpy as np

from robot.geometry.se2 import SE2
from robot.mission.drive import matter_near
from robot.mission.state import Situation
from robot.mission.touch import SIDES_RAD, Touch, wall_since

USUAL = 0.4  # where on a side it is touched when nothing is known: rather before it than beside it
REACH_M = 0.06  # matter that the map knows so near the rim is what was touched
DEPTH_M = 0.015  # the nearest of it, as thick as the map is unsure: its middle was touched
GAP_M = 0.005  # a touched thing is marked so far beyond the rim
STEP_M = 0.025  # marks so near to one another are a line in the map
STRIP_M = 0.3  # of a wall, to either side: who drives along it would touch it again and again
EDGE_M = 0.02  # an edge is marked so far outside the rim,
EDGE_RAD = 0.25  # and so wide to either side of the sensors that see no floor


def touched(now: Situation, last: Touch, half_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 2) of `world` on what was touched, and the direction (2,) into it.

    An earlier touch tells how it lies. Else what the map knows close to the rim was touched, and
    else the middle of the side is as good a guess as any. As much of what the map knows as lies
    along the touched tangent within `STRIP_M` is moved there: the map was off. At least `half_m` to
    either side is marked: more would close narrow passages, less would make the robot feel its way
    along what it cannot see.
    """
    rim_m = now.robot.radius_m + GAP_M
    at = now.pose.inverse().apply(matter_near(now.view, now.pose, rim_m + STRIP_M))
    wall = wall_since(last, now.run.touches)
    bearing_rad = _of_matter(now, last.side, at) if wall is None else wall[1]
    inward = np.array([math.cos(bearing_rad), math.sin(bearing_rad)])
    tangent = np.array([-inward[1], inward[0]])
    beyond, along = at @ inward - rim_m, at @ tangent
    moved = along[(np.abs(beyond) < REACH_M) & (np.abs(along) < STRIP_M)]
    ends = [-half_m, half_m]
    if wall is not None:  # from there to here, too
        before = (last.place.inverse() @ wall[0].place).apply(np.zeros((1, 2)))[0]
        ends += [before @ tangent - half_m, before @ tangent + half_m]
    marked = line(min(ends), max(ends))
    strip = np.outer(np.append(moved, marked), tangent)
    points = now.pose.apply(strip + rim_m * inward)
    return points, SE2(yaw_rad=now.pose.yaw_rad).apply(inward)


def over_edge_rad(now: Situation) -> np.ndarray:
    """Bearings (k,) in `base` of the sensors that see no floor."""
    sensors = np.array(now.robot.cliff_bearings_rad)
    return sensors[now.contact.cliff_sensors >> np.arange(len(sensors)) & 1 > 0]


def edge(now: Situation) -> np.ndarray:
    """Points (n, 2) of `world` on the edge of a cliff: outside the rim where no floor is seen."""
    over = over_edge_rad(now)
    if not len(over):  # already off the edge, or nobody told which one it was
        over = np.array(now.robot.cliff_bearings_rad)
    bearing = np.linspace(over.min() - EDGE_RAD, over.max() + EDGE_RAD, 11)
    reach_m = now.robot.radius_m + EDGE_M
    return now.pose.apply(reach_m * np.stack([np.cos(bearing), np.sin(bearing)], axis=-1))


def line(from_m: float, to_m: float) -> np.ndarray:
    """Places (n,) between both, near enough to one another to be a line in the map."""
    return np.linspace(from_m, to_m, 1 + max(1, round((to_m - from_m) / STEP_M)))


def _of_matter(now: Situation, side: float, at: np.ndarray) -> float:
    """Bearing of what was touched, by matter (n, 2) of `base` that the map knows."""
    low_rad, high_rad = SIDES_RAD[side]
    away, bearing = np.hypot(at[:, 0], at[:, 1]), np.arctan2(at[:, 1], at[:, 0])
    close = away < now.robot.radius_m + REACH_M
    close &= (bearing >= low_rad - 0.1) & (bearing <= high_rad + 0.1)
    if not close.any():
        return USUAL * (low_rad + high_rad)
    return float(bearing[close & (away < away[close].min() + DEPTH_M)].mean())
