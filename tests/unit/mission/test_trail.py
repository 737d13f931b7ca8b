"""Breadcrumbs lead back along the way that was driven."""

import numpy as np

from robot.geometry.se2 import SE2
from robot.mission.trail import EVERY_M, KEEP, Trail


def walked(n, step_m=0.0625):
    trail = Trail()
    for k in range(n):
        trail.drop_crumb(SE2(step_m * k, 0.0, 0.0))
    return trail


def test_crumbs_lie_apart_and_lead_back_from_the_newest():
    assert len(walked(101, EVERY_M / 4.5)) == 1 + 100 // 5
    back = walked(17).back(0.3)
    assert np.allclose(back[:, 0], 1.0 - 0.0625 * np.arange(7))


def test_what_was_gone_back_is_forgotten():
    trail = walked(17)
    trail.cut(0.3)
    assert np.isclose(trail.back(0.0)[0, 0], 1.0 - 6 * 0.0625)
    trail.cut(50.0)
    assert len(trail) == 0 and trail.back(1.0).shape == (0, 2)


def test_the_memory_is_bounded():
    assert len(walked(20_000)) == KEEP


def test_a_loop_is_not_gone_back():
    trail = walked(17)
    for k in range(40):  # about, and again where it was after a metre
        angle_rad = 2.0 * np.pi * k / 39.0
        trail.drop_crumb(SE2(1.0 + 0.3 * np.sin(angle_rad), 0.3 - 0.3 * np.cos(angle_rad), 0.0))
    back = trail.back(0.3)
    assert np.abs(back[:, 1]).max() < 0.01 and (np.diff(back[:, 0]) < 0.0).all()
