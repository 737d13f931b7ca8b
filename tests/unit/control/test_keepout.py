"""Lines that must not be crossed: whatever is wished, the footprint stays on its side."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.config import Config
from robot.control.safety import SafetyGate
from robot.control.wish import Wish
from robot.geometry.se2 import SE2, exp
from robot.messages import Contact, LinkState, Scan, Seen

CONFIG = Config()
RADIUS_M = CONFIG.robot.radius_m
TICK_NS = 20_000_000
BEARINGS = np.linspace(-0.6, 0.6, 41)


def drive(lines, wishes, start=None, seconds_each=1.0):
    """The way (n,) of poses that the gate allows in an empty, seen room."""
    gate, pose, t_ns = SafetyGate(CONFIG.control, CONFIG.robot), start or SE2(), 0
    way = [pose]
    for wish in wishes:
        for _ in range(round(seconds_each * 50)):
            t_ns += TICK_NS
            gate.contact(Contact(t_ns))
            gate.link(LinkState(t_ns, True))
            if t_ns % (5 * TICK_NS) == 0:
                scan = Scan(BEARINGS, np.full(41, np.nan), np.full(41, 3.0))
                gate.see(Seen(t_ns, t_ns, 0, (), scan, 1.0), pose)
                gate.keep_out.know(np.array(lines, float).reshape(-1, 4), pose)
            order = gate.check(t_ns, wish, pose, t_ns, True)
            pose = pose @ exp(order.v_mps * 0.02, 0.0, order.yaw_rate_radps * 0.02)
            way.append(pose)
    return way


def least_m(way, line):
    """Least distance of a way's centres from a line."""
    a, b = np.array(line[:2]), np.array(line[2:])
    points = np.array([(p.x_m, p.y_m) for p in way])
    t = np.clip(((points - a) @ (b - a)) / ((b - a) @ (b - a)), 0.0, 1.0)[:, None]
    return float(np.hypot(*(points - a - t * (b - a)).T).min())


def test_full_speed_ends_before_the_line():
    line = (1.0, -1.0, 1.0, 1.0)
    way = drive([line], [Wish(0.25)] * 6)
    assert RADIUS_M <= least_m(way, line) < RADIUS_M + 0.08


def test_backing_ends_before_the_line_too():
    line = (-0.5, -1.0, -0.5, 1.0)
    way = drive([line], [Wish(-0.12)] * 6)
    assert RADIUS_M <= least_m(way, line) < RADIUS_M + 0.08


@settings(max_examples=20, deadline=None)
@given(
    st.lists(st.tuples(st.floats(-0.2, 0.3), st.floats(-1.6, 1.6)), min_size=3, max_size=8),
    st.floats(-math.pi, math.pi),
    st.floats(0.35, 0.8),
)
def test_no_wish_crosses_a_line(wishes, bearing, away_m):
    c, s = math.cos(bearing), math.sin(bearing)
    x, y = away_m * c, away_m * s
    line = (x + 2.0 * s, y - 2.0 * c, x - 2.0 * s, y + 2.0 * c)
    way = drive([line], [Wish(v, w) for v, w in wishes])
    assert least_m(way, line) >= RADIUS_M


def test_a_robot_that_reaches_over_a_line_may_leave_but_not_go_on():
    line = (0.12, -1.0, 0.12, 1.0)
    assert least_m(drive([line], [Wish(0.2)] * 2), line) == pytest.approx(0.12, abs=0.005)
    assert drive([line], [Wish(-0.1)] * 3)[-1].x_m < -0.1


def test_before_a_line_it_may_turn_away_and_drive_on():
    line = (0.5, -1.0, 0.5, 1.0)
    way = drive([line], [Wish(0.25)] * 3 + [Wish(0.2, 1.2)] * 2 + [Wish(0.2)] * 2)
    assert way[-1].distance_m(way[150]) > 0.2 and least_m(way, line) >= RADIUS_M


def test_without_sight_only_wheel_only_driving_moves_and_slowly():
    gate = SafetyGate(CONFIG.control, CONFIG.robot)
    for k in range(1, 100):
        t_ns = k * TICK_NS
        gate.contact(Contact(t_ns))
        gate.link(LinkState(t_ns, True))
        wheel_only = k > 50
        wish = Wish(0.3, 0.0, 1.0, 1.0, wheel_only=wheel_only)
        order = gate.check(t_ns, wish, SE2(), t_ns, True)
        assert order.brush == order.fan == 0.0
        assert order.v_mps <= (CONFIG.control.wheel_only_mps if wheel_only else 0.0) + 1e-9
    assert order.v_mps == pytest.approx(0.1)
