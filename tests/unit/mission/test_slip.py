"""Slip is told from what the eyes see pass by."""

import numpy as np
import pytest

from robot.geometry.se2 import SE2
from robot.messages import VisualMotion, WheelTravel
from robot.mission.slip import SlipWatch

WIDTH_M = 0.23
NS = 100_000_000


def live(rolled, seen, frames=20, inliers=40, noise=0.003):
    """Both wheels roll `rolled` (left, right) a frame; the eyes see `seen` (x, yaw) a frame."""
    watch, rng = SlipWatch(WIDTH_M), np.random.default_rng(1)
    for k in range(frames):
        watch.wheels(WheelTravel(k * NS, k * NS, rolled[0] * k, rolled[1] * k))
        dx, dyaw = rng.normal(0.0, noise), rng.normal(0.0, 0.002)
        step = SE2(seen[0] + dx, 0.0, seen[1] + dyaw)
        watch.see(k * NS, VisualMotion(step, np.eye(3), inliers))
    return watch


@pytest.mark.parametrize("v", [0.025, -0.012, 0.005])
def test_good_wheels_do_not_slip(v):
    assert not live((v, v), (v, 0.0)).slipping


def test_turning_in_place_is_carried_by_both_wheels():
    w = 0.08
    assert not live((-w * WIDTH_M / 2, w * WIDTH_M / 2), (0.0, w)).slipping
    assert live((-w * 2 * WIDTH_M / 2, w * 2 * WIDTH_M / 2), (0.0, 0.1 * w)).slipping


@pytest.mark.parametrize("v", [0.025, -0.012])
def test_wheels_that_turn_in_vain_are_told(v):
    assert live((v, v), (0.05 * v, 0.0)).slipping


def test_without_eyes_or_after_forgetting_nothing_is_told():
    assert not live((0.025, 0.025), (0.0, 0.0), inliers=3).slipping
    watch = live((0.025, 0.025), (0.0, 0.0))
    watch.forget()
    assert not watch.slipping


def test_standing_still_is_no_slip():
    assert not live((0.0, 0.0), (0.0, 0.0)).slipping


@pytest.mark.parametrize(("share", "lost"), [(1.0, 0.0), (0.6, 0.4), (0.0, 1.0)])
def test_the_share_that_is_lost_is_measured(share, lost):
    assert live((0.025, 0.025), (0.025 * share, 0.0)).lost == pytest.approx(lost, abs=0.1)


def test_only_what_was_rolled_lately_counts_and_too_little_tells_nothing():
    assert np.isnan(live((0.005, 0.005), (0.005, 0.0)).lost)
    assert np.isnan(live((0.025, 0.025), (0.0, 0.0), frames=4).lost)
