"""The gate: denies by default, never exceeds a limit, slows before what is seen, lets back away."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.config import ControlConfig, RobotConfig
from robot.control.limits import stopping_distance_m
from robot.control.safety import SafetyGate
from robot.control.wish import Wish
from robot.geometry.se2 import SE2
from robot.messages import Contact, LinkState, Scan, Seen

CONTROL, ROBOT, HOME = ControlConfig(), RobotConfig(), SE2()
MS = 1_000_000
T0 = 1_000 * MS
BEARINGS = np.linspace(-0.6, 0.6, 61)
AHEAD = Wish(0.25, 0.0, 0.8, 0.8, "driving")


def scan_of(wall_x_m=math.inf, clear_m=3.0) -> Scan:
    """A wall across the way at `wall_x_m`, floor seen up to it or to `clear_m`."""
    along = wall_x_m / np.cos(BEARINGS)
    return Scan(BEARINGS, np.where(along < 3.0, along, np.nan), np.minimum(along, clear_m))


def stop_m(v_mps):
    return stopping_distance_m(v_mps, CONTROL.brake_mps2, CONTROL.reaction_s)


def seen(t_ns, scan):
    return Seen(t_ns, t_ns, 0, (), scan, 1.0)


def gate_at(t_ns=T0, scan=None, contact=None, link=None):
    gate = SafetyGate(CONTROL, ROBOT)
    gate.link(link or LinkState(t_ns, True))
    gate.contact(contact or Contact(t_ns))
    gate.see(seen(t_ns, scan or scan_of()), SE2())
    return gate


def run_up(gate, wish=AHEAD, pose=HOME, localised=True):
    """The order after the ramps have ended, before the only frame grows old."""
    for k in range(48):
        now_ns = T0 + k * 10 * MS
        order = gate.check(now_ns, wish, pose, now_ns, localised)
    return order


def test_denies_until_everything_has_been_heard():
    gate = SafetyGate(CONTROL, ROBOT)
    steps = [
        (lambda: None, "motor controller"),
        (lambda: gate.link(LinkState(T0, True)), "contact switches"),
        (lambda: gate.contact(Contact(T0)), "seen"),
        (lambda: gate.see(seen(T0, scan_of()), SE2()), "driving"),
    ]
    for feed, expected in steps:
        feed()
        order = gate.check(T0, AHEAD, SE2(), T0, True)
        assert expected in order.reason
        gate.check(T0 + 20 * MS, AHEAD, SE2(), T0, True)
    assert gate.check(T0 + 40 * MS, AHEAD, SE2(), None, True).v_mps == 0.0
    assert gate.check(T0 + 60 * MS, AHEAD, SE2(), T0, True).v_mps > 0.0


@pytest.mark.parametrize(
    ("link", "contact"),
    [
        (LinkState(T0, False), Contact(T0)),
        (LinkState(T0, True, "bumper"), Contact(T0)),
        (LinkState(T0 - 2_000 * MS, True), Contact(T0)),
        (LinkState(T0, True), Contact(T0 - 600 * MS)),
        (LinkState(T0, True), Contact(T0, wheel_drop=True)),
    ],
)
def test_nothing_moves_not_even_backwards_when_the_drive_cannot_be_trusted(link, contact):
    for wish in (AHEAD, Wish(-0.1), Wish(0.0, 1.0)):
        order = run_up(gate_at(link=link, contact=contact), wish)
        assert (order.v_mps, order.yaw_rate_radps, order.brush, order.fan) == (0, 0, 0, 0)


@pytest.mark.parametrize(
    "contact", [Contact(T0, bump_left=True), Contact(T0, bump_right=True), Contact(T0, cliff=True)]
)
def test_at_a_contact_only_backing_slowly_is_left(contact):
    assert run_up(gate_at(contact=contact)).v_mps == 0.0
    assert run_up(gate_at(contact=contact), Wish(0.0, 1.0)).yaw_rate_radps == 0.0
    back = run_up(gate_at(contact=contact), Wish(-0.25))
    assert back.v_mps == pytest.approx(-CONTROL.back_mps)
    arc = run_up(gate_at(contact=contact), Wish(-0.1, 0.8))
    assert arc.v_mps == pytest.approx(-0.1) and arc.yaw_rate_radps == pytest.approx(0.8)
    assert run_up(gate_at(contact=contact), Wish(-0.05, 0.8)).yaw_rate_radps == 0.0


def test_old_frames_slow_then_stop_but_backing_away_stays():
    gate = gate_at()
    for age_ms, low, high in ((10, 0.2, 0.25), (700, 0.0, CONTROL.stale_mps), (1600, 0.0, 0.0)):
        for k in range(48):
            now_ns = T0 + age_ms * MS + k * 10 * MS
            gate.link(LinkState(now_ns, True))
            gate.contact(Contact(now_ns))
            order = gate.check(now_ns, AHEAD, SE2(), now_ns, True)
        assert low <= order.v_mps <= high
    assert gate.verdict.denied
    for k in range(30):
        order = gate.check(now_ns + k * 10 * MS, Wish(-0.1), SE2(), now_ns, True)
    assert order.v_mps < -0.05


def test_stops_within_what_it_sees():
    for wall_m in (0.25, 0.3, 0.35, 0.4, 0.5, 0.8):
        order = run_up(gate_at(scan=scan_of(wall_m)))
        free_m = wall_m - ROBOT.radius_m - CONTROL.stop_gap_m + 0.004
        if order.v_mps > CONTROL.touch_mps:
            assert (
                stopping_distance_m(order.v_mps, CONTROL.brake_mps2, CONTROL.reaction_s) <= free_m
            )
    assert run_up(gate_at(scan=scan_of(0.18))).v_mps <= CONTROL.touch_mps
    assert run_up(gate_at(scan=scan_of(0.8))).v_mps == pytest.approx(0.25)


def test_a_contact_is_never_faster_than_agreed():
    """Drive up to a wall that was seen and then left the camera's view: the memory must hold."""
    gate, x_m, v = gate_at(scan=scan_of(0.8)), 0.0, 0.0
    for k in range(400):
        now_ns = T0 + k * 20 * MS
        gate.link(LinkState(now_ns, True))
        gate.contact(Contact(now_ns))
        if k % 5 == 0:
            nothing = Scan(BEARINGS, np.full(61, np.nan), np.zeros(61))
            gate.see(seen(now_ns, nothing), SE2(x_m))
        order = gate.check(now_ns, AHEAD, SE2(x_m), now_ns, True)
        v += (order.v_mps - v) * 0.2
        x_m += v * 0.02
        if x_m + ROBOT.radius_m >= 0.8:
            break
    assert x_m + ROBOT.radius_m >= 0.8, "it should creep up to the wall"
    assert v <= 0.1


def test_unknown_floor_ahead_is_entered_slowly():
    nothing = Scan(BEARINGS, np.full(61, np.nan), np.zeros(61))
    assert run_up(gate_at(scan=nothing)).v_mps == pytest.approx(CONTROL.unknown_mps)


def test_something_beside_the_way_slows_without_stopping():
    gate = gate_at()
    side = Scan(np.array([1.02, 1.11, 1.20]), np.full(3, 0.202), np.full(3, 0.2))
    gate.see(seen(T0, side), SE2())
    order = run_up(gate)
    assert order.v_mps == pytest.approx(CONTROL.near_mps)


def test_a_curve_looks_along_the_curve():
    """A pillar 0.4 m ahead is missed by a tight left turn, and one on the left is not."""
    angles = np.linspace(-0.1, 0.1, 9)
    front = Scan(angles, np.full(9, 0.45), np.full(9, 0.4))
    gate = gate_at(scan=front)
    corridor = gate.sight.corridor(SE2(), 1, 0.0)
    assert corridor.free_m == pytest.approx(0.45 - 0.17, abs=0.03)
    assert gate.sight.corridor(SE2(), 1, 1 / 0.15).free_m == math.inf
    assert gate.sight.corridor(SE2(), -1, 0.0).free_m == math.inf
    gate = gate_at(scan=Scan(angles + 0.9, np.full(9, 0.45), np.full(9, 0.4)))
    assert gate.sight.corridor(SE2(), 1, 0.0).free_m == math.inf
    arc = gate.sight.corridor(SE2(), 1, 1 / 0.3).free_m
    assert 0.05 < arc < 0.45
    right = gate_at(scan=Scan(-angles[::-1] - 0.9, np.full(9, 0.45), np.full(9, 0.4)))
    assert right.sight.corridor(SE2(), 1, -1 / 0.3).free_m == pytest.approx(arc, rel=1e-9)


def test_free_distance_on_an_arc_agrees_with_stepping_along_it():
    rng = np.random.default_rng(5)
    for _ in range(60):
        point = rng.uniform(-0.8, 0.8, 2)
        curvature = rng.uniform(-6, 6)
        if math.hypot(*point) < 0.2:
            continue
        bearing = math.atan2(point[1], point[0])
        gate = SafetyGate(CONTROL, ROBOT)
        gate.sight.know(point[None])
        exact = gate.sight.corridor(SE2(), 1, curvature).free_m + CONTROL.graze_m
        if exact <= CONTROL.graze_m:
            continue
        r = ROBOT.radius_m - CONTROL.graze_m
        s = np.arange(0, 0.75 * 2 * math.pi / max(abs(curvature), 0.5), 0.001)
        xs, ys = np.sin(curvature * s) / curvature, (1 - np.cos(curvature * s)) / curvature
        hits = np.hypot(xs - point[0], ys - point[1]) < r
        stepped = s[np.argmax(hits)] if hits.any() else math.inf
        if math.isfinite(exact) and exact < s[-1] and bearing > -2.5 and abs(bearing) < 2.5:
            assert stepped == pytest.approx(exact, abs=0.004)
        if math.isfinite(stepped) and stepped < 0.4 * 2 * math.pi / abs(curvature):
            assert exact == pytest.approx(stepped, abs=0.004)


def test_a_point_is_forgotten_when_the_floor_there_is_seen_again():
    gate = gate_at(scan=scan_of(0.6))
    assert math.isfinite(gate.sight.corridor(SE2(), 1, 0.0).free_m)
    gate.see(seen(T0 + 100 * MS, scan_of()), SE2())
    assert gate.sight.corridor(SE2(), 1, 0.0).free_m == math.inf


def test_brush_and_fan_run_only_while_localised():
    assert run_up(gate_at()).brush == AHEAD.brush
    order = run_up(gate_at(), localised=False)
    assert (order.brush, order.fan) == (0.0, 0.0) and order.v_mps > 0.0


any_float = st.floats(allow_nan=True, allow_infinity=True)
contacts = st.builds(Contact, st.just(T0), *[st.booleans()] * 5)


@settings(max_examples=150, deadline=None)
@given(
    st.lists(st.builds(Wish, any_float, any_float, any_float, any_float), min_size=1, max_size=8),
    contacts,
    st.one_of(st.none(), st.floats(0.05, 2.0)),
    st.booleans(),
    st.booleans(),
    st.sampled_from(["", "bumper"]),
    st.integers(0, 2500),
)
def test_no_wish_gets_past_the_gate(wishes, contact, wall_m, localised, connected, stop, age_ms):
    gate = SafetyGate(CONTROL, ROBOT)
    gate.link(LinkState(T0 + age_ms * MS, connected, stop))
    gate.contact(contact)
    if wall_m is not None:
        gate.see(seen(T0, scan_of(wall_m)), SE2())
    for k, wish in enumerate(wishes):
        now_ns = T0 + age_ms * MS + k * 20 * MS
        order = gate.check(now_ns, wish, SE2(), now_ns, localised)
        assert abs(order.v_mps) <= ROBOT.cruise_mps
        assert abs(order.yaw_rate_radps) <= ROBOT.max_yaw_rate_radps
        assert 0.0 <= order.brush <= 1.0 and 0.0 <= order.fan <= 1.0
        assert order.v_mps >= -CONTROL.back_mps
        assert localised or order.brush == order.fan == 0.0
        assert order.valid_for_ms == CONTROL.valid_for_ms
        moving = order.v_mps != 0.0 or order.yaw_rate_radps != 0.0
        if not connected or stop or contact.wheel_drop or age_ms > 500:
            assert not moving or age_ms <= 560
        if wall_m is None or contact.cliff or contact.bump_left or contact.bump_right:
            assert order.v_mps <= 0.0
        if contact.cliff or contact.bump_left or contact.bump_right:
            turn_mps = 0.5 * ROBOT.track_width_m * abs(order.yaw_rate_radps)
            assert order.v_mps + turn_mps <= 1e-12  # neither wheel pushes forward
        if order.v_mps > CONTROL.touch_mps:
            free_m = wall_m - ROBOT.radius_m + 0.005
            assert (
                stopping_distance_m(order.v_mps, CONTROL.brake_mps2, CONTROL.reaction_s) <= free_m
            )
