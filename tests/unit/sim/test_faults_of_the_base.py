"""What is broken on purpose behaves as broken things do."""

import numpy as np
import pytest

from robot.config import Config
from robot.geometry.se2 import SE2
from robot.sim.base import SimBase
from robot.sim.drawn import DrawnSight
from robot.sim.faults import Patch
from robot.sim.scene import load_scene

CONFIG = Config()


@pytest.fixture
def base():
    made = SimBase(load_scene("studio"), CONFIG.robot, CONFIG.sim, 1, metres_per_tick=0.0002)
    made.carry_to(SE2(1.9, 1.4, 0.0))
    return made


def drive(base, left, right, seconds=1.0):
    start = base.world_from_base
    for _ in range(round(seconds * 200)):
        base.step(0.005, left, right)
    return start.inverse() @ base.world_from_base


def test_slipping_wheels_roll_but_hardly_carry(base):
    base.faults.slip = 0.95
    moved = drive(base, 0.3, 0.3)
    assert 0.0 < moved.x_m < 0.02 and base.left_ticks * 0.0002 > 0.1


def test_a_blocked_wheel_stands_and_the_other_turns_the_robot(base):
    base.faults.blocked = 0
    moved = drive(base, 0.3, 0.3)
    assert abs(base.left_ticks) < 10 < base.right_ticks and moved.yaw_rad > 0.3


def test_a_patch_holds_ahead_and_lets_go_backwards(base):
    square = np.array([[1.7, 1.2], [2.1, 1.2], [2.1, 1.6], [1.7, 1.6]])
    base.faults.patches.append(Patch(square, slip=1.0))
    assert drive(base, 0.3, 0.3).x_m == pytest.approx(0.0, abs=1e-6)
    assert base.faults.entered
    assert drive(base, -0.3, -0.3).x_m < -0.1


def test_a_held_bumper_stays_pressed_and_a_lifted_robot_goes_nowhere(base):
    base.faults.bump_held = True
    drive(base, 0.1, 0.1, 0.02)
    assert base.bump_left and base.bump_right
    base.lift()
    moved = drive(base, 0.4, 0.4)
    assert base.wheel_drop and abs(moved.x_m) < 1e-9 and not base.cliff_entered
    base.carry_to(SE2(1.5, 1.4, 0.0))
    assert not base.wheel_drop


def test_a_changed_world_is_felt_and_seen_and_the_dark_shows_nothing(base):
    world = base._world
    sight = DrawnSight(world, CONFIG, 1)
    before = np.nanmin(sight.see(0, 0, 0, base.world_from_base).scan.range_m)
    box = np.array([[2.4, 1.2], [2.5, 1.2], [2.5, 1.6], [2.4, 1.6]])
    changed = type(world)(
        world.name, (*world.obstacles, box), world.cliffs, world.dock, world.start, world.draw
    )
    base.rebuild(changed)
    sight.rebuild(changed)
    after = np.nanmin(sight.see(1, 1, 1, base.world_from_base).scan.range_m)
    assert after < before and after == pytest.approx(0.5, abs=0.1)
    drive(base, 0.4, 0.4, 3.0)
    assert base.bump_left or base.bump_right
    sight.dark = True
    seen = sight.see(2, 2, 2, base.world_from_base)
    assert seen.quality == 0.0 and not seen.landmarks and np.isnan(seen.scan.range_m).all()
