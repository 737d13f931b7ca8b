"""The simulated body: wheels, walls, bumper, stairs, dock, gyro."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.config import RobotConfig, SimConfig
from robot.geometry.se2 import SE2, exp
from robot.sim.base import SimBase
from robot.sim.scene import load_scene

ROBOT = RobotConfig()
TICK_M = 0.0002


def base_in(world, sim, seed=1):
    return SimBase(world, ROBOT, sim, seed, metres_per_tick=TICK_M)


def drive(base, left, right, seconds, dt_s=0.005):
    for _ in range(round(seconds / dt_s)):
        base.step(dt_s, left, right)


def test_without_faults_the_encoders_tell_the_truth(flat, perfect):
    base = base_in(flat, perfect)
    estimate, last = base.world_from_base, (0, 0)
    for k in range(800):
        base.step(0.005, -0.3 - 0.1 * math.sin(k / 90), -0.3 + 0.1 * math.sin(k / 70))
        ticks = base.left_ticks, base.right_ticks
        left, right = ((b - a) * TICK_M for a, b in zip(last, ticks, strict=True))
        estimate = estimate @ exp((left + right) / 2, 0.0, (right - left) / ROBOT.track_width_m)
        last = ticks
    assert estimate.distance_m(base.world_from_base) < 0.005
    assert base.contacts == []


def test_a_slip_rolls_farther_than_it_carries(flat, perfect):
    sim = SimConfig(**{f: getattr(perfect, f) for f in perfect.__struct_fields__} | {
        "slip_every_s": 0.01, "slip_share": 0.5})  # fmt: skip
    base = base_in(flat, sim)
    start = base.world_from_base
    drive(base, -0.2, -0.2, 4.5)
    rolled = -(base.left_ticks + base.right_ticks) / 2 * TICK_M
    assert start.distance_m(base.world_from_base) < 0.99 * rolled


def test_driving_into_a_wall_presses_the_bumper_and_stops(flat, perfect):
    base = base_in(flat, perfect)
    base.carry_to(SE2(2.3, 2.05, 0.0))  # facing the wall between the doors
    drive(base, 0.35, 0.35, 4.0)
    assert base.world_from_base.x_m <= 2.95 - ROBOT.radius_m + 1e-6
    assert base.bump_left and base.bump_right
    assert len(base.contacts) == 1
    assert base.contacts[0][1] == pytest.approx(0.21, abs=0.02)


def test_a_wall_met_at_an_angle_is_slid_along(flat, perfect):
    base = base_in(flat, perfect)
    base.carry_to(SE2(2.6, 1.9, math.radians(30.0)))  # the wall's end is at y = 2.5
    drive(base, 0.3, 0.3, 2.6)
    x_m, y_m = base.world_from_base.x_m, base.world_from_base.y_m
    assert x_m == pytest.approx(2.95 - 0.012 - ROBOT.radius_m, abs=1e-6)
    assert y_m > 1.9 + 0.6 * 0.3 * 2.5 * math.sin(math.radians(30.0)) - 0.02
    assert len(base.contacts) == 1


@pytest.mark.parametrize(("yaw_deg", "side"), [(50.0, "right"), (-50.0, "left")])
def test_a_glancing_touch_presses_its_own_side(flat, perfect, yaw_deg, side):
    base = base_in(flat, perfect)
    base.carry_to(SE2(2.6, 2.05, math.radians(yaw_deg)))
    drive(base, 0.2, 0.2, 3.0)
    assert (base.bump_left, base.bump_right) == (side == "left", side == "right")


@settings(max_examples=25, deadline=None)
@given(st.lists(st.tuples(st.floats(-1, 1), st.floats(-1, 1)), min_size=3, max_size=12))
def test_nothing_is_ever_driven_through(orders):
    world = load_scene_once()
    base = base_in(world, SimConfig(), seed=3)
    base.carry_to(SE2(1.5, 1.4, 0.3))
    walls = world.segments()
    for left, right in orders:
        drive(base, left, right, 0.6)
        p = np.array([base.world_from_base.x_m, base.world_from_base.y_m])
        a, b = walls[:, :2], walls[:, 2:] - walls[:, :2]
        t = np.clip(np.sum((p - a) * b, axis=1) / np.sum(b * b, axis=1), 0, 1)
        nearest = np.hypot(*(a + t[:, None] * b - p).T).min()
        assert nearest > ROBOT.radius_m - 1e-6


def load_scene_once(_cache=[]):  # noqa: B006
    if not _cache:
        _cache.append(load_scene("flat"))
    return _cache[0]


def test_stairs_are_felt_before_a_wheel_goes_over(perfect):
    base = base_in(load_scene("stairs"), perfect)
    base.carry_to(SE2(2.8, 1.9, 0.0))
    while not base.cliff:
        base.step(0.005, 0.3, 0.3)
    assert base.cliff_sensors == 0b0110 and not base.cliff_entered
    drive(base, 0.3, 0.3, 2.0)
    assert base.cliff_entered


@settings(max_examples=20, deadline=None)
@given(st.floats(-60.0, 60.0), st.floats(1.5, 2.3))
def test_every_edge_is_felt_while_there_is_room_to_stop(heading_deg, y_m):
    """At 0.1 m/s, stopping dead when a sensor looks into the stairs, no wheel gets there."""
    world = load_stairs_once()
    base = base_in(world, SimConfig(), seed=2)
    yaw_rad = math.radians(heading_deg)
    base.carry_to(SE2(3.3 - 0.35 * math.cos(yaw_rad), y_m - 0.35 * math.sin(yaw_rad), yaw_rad))
    for _ in range(1000):
        base.step(0.005, 0.17, 0.17)
        if base.cliff:
            break
    assert base.cliff and not base.wheel_drop
    drive(base, 0.0, 0.0, 0.5)
    assert not base.cliff_entered


def test_over_the_edge_it_hangs_until_it_is_carried_away(perfect):
    base = base_in(load_stairs_once(), perfect)
    base.carry_to(SE2(2.9, 1.9, 0.0))
    drive(base, 0.3, 0.3, 3.0)
    fallen = base.world_from_base
    assert base.wheel_drop and base.cliff_entered
    drive(base, -0.3, -0.3, 1.0)
    assert base.world_from_base == fallen
    base.carry_to(SE2(1.5, 1.2, 0.0))
    drive(base, 0.3, 0.3, 0.5)
    assert not base.wheel_drop and base.cliff_entered
    assert base.world_from_base.x_m > 1.55


def load_stairs_once(_cache=[]):  # noqa: B006
    if not _cache:
        _cache.append(load_scene("stairs"))
    return _cache[0]


def test_a_second_wall_is_a_second_contact(flat, perfect):
    """Sliding along one wall into the other of a corner."""
    base = base_in(flat, perfect)
    base.carry_to(SE2(2.6, 0.5, math.radians(-45.0)))
    drive(base, 0.3, 0.3, 6.0)
    assert len(base.contacts) == 2
    assert [t for t, _ in base.contacts] == sorted(t for t, _ in base.contacts)


def test_the_battery_drains_and_the_dock_fills_it(flat, perfect):
    base = base_in(flat, perfect)
    full = base.battery_v
    base.carry_to(SE2(1.5, 1.4, 0.0))
    drive(base, -0.4, 0.4, 20.0)
    drained = base.battery_v
    assert drained < full
    base.carry_to(flat.start)
    drive(base, 0.0, 0.0, 10.0)
    assert drained < base.battery_v <= full


def test_it_charges_on_the_dock_and_only_there(flat, perfect):
    base = base_in(flat, perfect)
    assert base.charging and base.contacts == []
    drive(base, -0.3, -0.3, 1.5)
    assert not base.charging
    drive(base, 0.1, 0.1, 8.0)
    assert base.charging and base.contacts == [] and not base.bump_left


def test_the_gyro_shows_the_turn_rate(flat, perfect):
    base = base_in(flat, perfect)
    base.carry_to(SE2(1.5, 1.4, 0.0))
    drive(base, -0.2, 0.2, 1.0)
    base.yaw_rate_radps()
    drive(base, -0.2, 0.2, 0.5)
    assert base.yaw_rate_radps() == pytest.approx(2 * 0.2 * 0.6 / ROBOT.track_width_m, rel=0.01)


def test_a_seed_is_a_life(flat):
    poses = []
    for seed in (4, 4, 5):
        base = base_in(flat, SimConfig(), seed)
        drive(base, -0.3, -0.25, 3.0)
        poses.append((base.world_from_base, base.yaw_rate_radps()))
    assert poses[0] == poses[1] != poses[2]
