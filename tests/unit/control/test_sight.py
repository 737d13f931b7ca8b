"""What was seen beside the robot, and how near it is to its flank."""

import math

import numpy as np
import pytest

from robot.config import Config
from robot.control.sight import Sight
from robot.geometry.se2 import SE2
from robot.messages import Scan

CONFIG = Config()
BEARINGS = np.linspace(-0.6, 0.6, 120)
RADIUS_M = CONFIG.robot.radius_m


def room_beside_m(sight, pose, side):
    left_m, right_m = sight.rooms_beside_m(pose)
    return left_m if side > 0 else right_m


def driven_along(room_m, side, until_m=1.5):
    """A sight that passed a wall `room_m` beside its flank, and where it is."""
    sight, y_wall = Sight(CONFIG.control, CONFIG.robot), side * (RADIUS_M + room_m)
    for k in range(round(until_m / 0.025)):
        pose = SE2(0.025 * k)
        range_m = np.full(len(BEARINGS), math.nan)
        meets = BEARINGS * side > 0.05
        range_m[meets] = y_wall / np.sin(BEARINGS[meets])
        sight.see(k * 100_000_000, pose, Scan(BEARINGS, range_m, np.nan_to_num(range_m, nan=2.0)))
    return sight, pose


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("room_m", [0.0, 0.008, 0.04])
def test_the_room_to_a_wall_that_was_seen_is_known_beside_it(side, room_m):
    sight, pose = driven_along(room_m, side)
    assert room_beside_m(sight, pose, side) == pytest.approx(room_m, abs=0.002)
    assert math.isnan(room_beside_m(sight, pose, -side))
    nearer = pose @ SE2(0.0, side * 0.01)
    assert room_beside_m(sight, nearer, side) == pytest.approx(room_m - 0.01, abs=0.002)


def test_a_wall_farther_off_is_nothing_to_drive_along():
    sight, pose = driven_along(0.12, 1)
    assert math.isnan(room_beside_m(sight, pose, 1))


def test_what_stands_before_the_robot_is_not_beside_it():
    sight = Sight(CONFIG.control, CONFIG.robot)
    range_m = 0.19 / np.cos(BEARINGS)
    sight.see(0, SE2(), Scan(BEARINGS, range_m, range_m))
    assert math.isnan(room_beside_m(sight, SE2(), 1))
    assert math.isnan(room_beside_m(sight, SE2(), -1))
