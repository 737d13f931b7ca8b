"""Leaving the dock: what the robot knows of it without having seen it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from robot.config import Config
from robot.geometry.se2 import SE2
from robot.mapping.grid import OccupancyGrid
from robot.mission.states.undock import Undock

CONFIG = Config()


def test_the_dock_is_on_the_map_before_the_robot_has_left_it():
    pose = SE2(1.0, -2.0, 0.7)
    now = SimpleNamespace(
        t_ns=0,
        pose=pose,
        odom=SE2(),
        sight=SimpleNamespace(world_from_docked=None),
        grid=OccupancyGrid(CONFIG.mapping),
        robot=CONFIG.robot,
    )
    Undock().enter(now)
    now.grid.clear_footprint(pose, CONFIG.robot.radius_m)  # it still stands there
    grid = now.grid.snapshot()
    ys, xs = np.nonzero(grid.cells >= 50)
    cells = np.stack([xs + 0.5, ys + 0.5], axis=-1) * grid.resolution_m
    marked = pose.inverse().apply(cells + (grid.origin_x_m, grid.origin_y_m))
    assert now.sight.world_from_docked == pose
    assert marked[:, 0].min() > CONFIG.robot.radius_m - 0.03
    assert np.ptp(marked[:, 1]) > CONFIG.robot.dock_width_m - 0.02


@pytest.mark.parametrize(("known_m2", "then"), [(0.5, "look"), (12.0, "work")])
def test_who_knows_the_home_does_not_look_around_first(known_m2, then):
    now = SimpleNamespace(
        t_ns=0,
        pose=SE2(),
        odom=SE2(),
        sight=SimpleNamespace(world_from_docked=None, learn=lambda t_ns, docked: None),
        grid=OccupancyGrid(CONFIG.mapping),
        robot=CONFIG.robot,
        config=CONFIG.mission,
        contact=SimpleNamespace(cliff=False),
        latched=False,
        run=SimpleNamespace(errand=None),
        known_free_m2=known_m2,
    )
    undock = Undock()
    undock.enter(now)
    now.odom = SE2(-CONFIG.mission.undock_m - 0.01)
    assert undock.tick(now).then == then
