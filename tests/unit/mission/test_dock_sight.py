"""Sightings of the dock's marker are averaged and tell where the docked pose is."""

import math

import numpy as np
import pytest

from robot.config import RobotConfig
from robot.geometry.se2 import SE2
from robot.messages import Marker
from robot.mission.dock_sight import KEEP_NS, DockSight

ROBOT = RobotConfig()
TRUE_MARKER = SE2(
    0.24, 0.01, math.pi - 0.02
)  # in the frame of the docked robot, which is odom here
MS = 1_000_000


def marker(base_from_marker, sigma_m=0.01, sigma_rad=0.08, marker_id=ROBOT.dock_marker_id):
    return Marker(marker_id, base_from_marker, np.diag([sigma_m**2, sigma_m**2, sigma_rad**2]))


def noisy_sightings(sight, n=30, seed=1, sigma_m=0.01, sigma_rad=0.08):
    rng = np.random.default_rng(seed)
    for k in range(n):
        base = SE2(-0.2 - 0.015 * k, 0.0, 0.0)
        true = base.inverse() @ TRUE_MARKER
        dx, dy, dyaw = rng.normal(0, 1, 3) * (sigma_m, sigma_m, sigma_rad)
        seen = SE2(true.x_m + dx, true.y_m + dy, true.yaw_rad + dyaw)
        sight.see(k * 100 * MS, marker(seen, sigma_m, sigma_rad), base, base)


def test_averaging_beats_one_sighting():
    sight = DockSight(ROBOT)
    noisy_sightings(sight)
    found = sight.marker(3_000 * MS)
    assert found.distance_m(TRUE_MARKER) < 0.006
    assert abs(math.remainder(found.yaw_rad - TRUE_MARKER.yaw_rad, math.tau)) < 0.04


def test_what_is_learned_when_undocking_leads_back_to_the_docked_pose():
    sight = DockSight(ROBOT)
    noisy_sightings(sight)
    assert sight.learn(3_000 * MS, SE2())
    sight.forget()
    assert sight.docked(3_000 * MS, 0.0, 0.03) is None
    odom_from_docked = SE2(2.0, -1.0, 0.7)  # odometry has drifted since
    base = odom_from_docked @ SE2(-0.6, 0.05, 0.0)
    sight.see(9_000 * MS, marker(base.inverse() @ odom_from_docked @ TRUE_MARKER), base, base)
    docked = sight.docked(9_000 * MS, 0.7, 0.03)
    assert docked.distance_m(odom_from_docked) < 0.015
    assert docked.yaw_rad == pytest.approx(0.7, abs=0.03)


def test_the_map_steadies_the_direction_of_a_skew_sighting():
    sight = DockSight(ROBOT)
    sight.learn(0, SE2())
    skewed = TRUE_MARKER @ SE2(0.0, 0.0, 0.2)
    sight.see(0, marker(skewed), SE2(), SE2())
    sure = sight.docked(0, 0.0, 0.001).yaw_rad
    unsure = sight.docked(0, 0.0, 1.0).yaw_rad
    assert abs(sure) < 0.02 < abs(unsure)


def test_other_markers_and_nonsense_are_ignored():
    sight = DockSight(ROBOT)
    sight.see(0, marker(TRUE_MARKER, marker_id=ROBOT.dock_marker_id + 1), SE2(), SE2())
    sight.see(0, marker(SE2(math.nan, 0.0, 0.0)), SE2(), SE2())
    assert sight.marker(0) is None and sight.seen_ns is None
    assert not sight.learn(0, SE2())


def test_old_sightings_are_not_believed():
    sight = DockSight(ROBOT)
    sight.see(0, marker(TRUE_MARKER), SE2(), SE2())
    assert sight.sightings(0) == 1
    assert sight.marker(KEEP_NS + 1) is None


def test_a_robot_that_did_not_start_docked_learns_the_dock_s_place_by_seeing_it():
    sight = DockSight(ROBOT)
    world_from_docked = SE2(3.0, 1.0, -0.5)
    world_from_base = world_from_docked @ SE2(-0.8, 0.1, 0.1)
    seen = world_from_base.inverse() @ world_from_docked @ sight.docked_from_marker
    sight.see(0, marker(seen), SE2(7.0), world_from_base)
    assert sight.world_from_docked.distance_m(world_from_docked) < 1e-9
    assert sight.world_from_docked.yaw_rad == pytest.approx(-0.5)
