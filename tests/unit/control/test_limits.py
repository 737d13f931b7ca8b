"""Speeds change no faster than the drive can follow, and braking distances add up."""

import math

from hypothesis import given
from hypothesis import strategies as st

from robot.config import ControlConfig, RobotConfig
from robot.control.limits import MAX_STEP_S, Ramp, braking_speed_mps, stopping_distance_m

CONTROL, ROBOT = ControlConfig(), RobotConfig()
any_speed = st.floats(allow_nan=True, allow_infinity=True, width=32)


@given(st.lists(st.tuples(any_speed, any_speed, st.floats(-1, 1)), max_size=30))
def test_ramp_never_leaves_its_limits_whatever_is_wished(wishes):
    ramp = Ramp(CONTROL, ROBOT)
    v, w = 0.0, 0.0
    for wished_v, wished_w, dt_s in wishes:
        new_v, new_w = ramp.step(wished_v, wished_w, dt_s)
        assert abs(new_v) <= ROBOT.cruise_mps and abs(new_w) <= ROBOT.max_yaw_rate_radps
        assert abs(new_v) - abs(v) <= CONTROL.acceleration_mps2 * MAX_STEP_S + 1e-9
        assert abs(new_w - w) <= CONTROL.yaw_acceleration_radps2 * MAX_STEP_S + 1e-9
        v, w = new_v, new_w


def test_ramp_reaches_the_wish():
    ramp = Ramp(CONTROL, ROBOT)
    for _ in range(60):
        v, w = ramp.step(0.2, -1.0, 0.02)
    assert v == 0.2 and w == -1.0


def test_ramp_passes_through_a_standstill_when_reversing():
    ramp = Ramp(CONTROL, ROBOT, v_mps=0.01)
    v, _ = ramp.step(-0.2, 0.0, 0.1)
    assert v == 0.0


@given(st.floats(0, 5), st.floats(0.1, 3), st.floats(0, 1))
def test_braking_speed_uses_exactly_the_free_distance(free_m, brake_mps2, reaction_s):
    v = braking_speed_mps(free_m, brake_mps2, reaction_s)
    assert math.isclose(stopping_distance_m(v, brake_mps2, reaction_s), free_m, abs_tol=1e-6)


@given(st.floats(-5, 0))
def test_no_free_distance_means_no_speed(free_m):
    assert braking_speed_mps(free_m, 0.6, 0.2) == 0.0
