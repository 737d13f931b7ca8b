"""Somebody walks about before the robot: nobody is hit, and no floor is lost to where feet were."""

import cv2
import pytest

from robot.bench.trial import Trial, box
from robot.config import Config
from robot.geometry.se2 import SE2

AHEAD_M, FEET_M = 0.5, 0.13
COMES_S, STEP_S, GOES_S, END_S = 20.0, 1.5, 33.0, 80.0


@pytest.fixture(scope="module")
def walked():
    """A run with two feet that step before the robot again and again, and where they stood."""
    cv2.setNumThreads(1)
    trial = Trial(Config(), "flat", 1)
    trial.end_s = END_S
    empty, feet, steps = trial.world, [], []

    def script(trial, t_s):
        if COMES_S < t_s < GOES_S and t_s > COMES_S + STEP_S * len(steps):
            steps.append(t_s)
            trial.rebuild(empty)
            both = [trial.pose @ SE2(AHEAD_M, side) for side in (-FEET_M, FEET_M)]
            trial.put(*(box(foot, 0.1, 0.1) for foot in both))
            feet.extend(both)
        elif t_s >= GOES_S and trial.world is not empty:
            trial.rebuild(empty)

    trial.live(script)
    return trial, feet


def test_nobody_is_hit_and_the_work_goes_on(walked):
    trial, feet = walked
    assert len(feet) > 12
    assert all(v <= 0.15 for _, v in trial.base.contacts)
    assert trial.state in ("clean", "recover")
    before = next(s.covered_m2 for s in trial.states if s.t_ns * 1e-9 >= GOES_S)
    assert trial.states[-1].covered_m2 > before + 0.1


def test_where_they_stood_is_floor_again(walked):
    trial, feet = walked
    memory = trial.brain.home().grid
    world_from_scene = trial.world.start.inverse()

    def solid(foot: SE2) -> bool:
        at = world_from_scene @ foot
        column = int(at.x_m // memory.resolution_m) - memory.ix0
        row = int(at.y_m // memory.resolution_m) - memory.iy0
        return bool(memory.log_odds[row, column] > 0.0 or memory.sticky[row, column])

    assert sum(solid(foot) for foot in feet) <= 0.2 * len(feet)
