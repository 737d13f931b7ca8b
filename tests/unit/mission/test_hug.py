"""Driving along a wall by touch: nearer bit by bit, off it where it is felt, and on."""

import math

import numpy as np
import pytest
from situations import situation

from robot.config import Config
from robot.control.wish import Wish
from robot.geometry.se2 import SE2, exp
from robot.messages import ClearOrder, Contact, LinkState, Scan
from robot.mission.hug import ASIDE_M, CAREFUL_MPS, SWING_RAD, SWUNG_S, Hug
from robot.mission.touch import Touch

CONFIG = Config()
RADIUS_M = CONFIG.robot.radius_m
TICK_NS = 20_000_000
CRUISE_MPS = 0.15
BEARINGS = np.linspace(-0.6, 0.6, 120)


class Along:
    """A robot that drives along x in whatever distance it is told, beside a wall at `wall_m`.

    `side` is that of the wall; what it sees of it stands `seen_off_m` farther off than it is.
    """

    def __init__(self, side, wall_m, seen_off_m=0.0):
        self.side, self.wall_m = side, wall_m
        self.now, self.hug = situation(CONFIG, Contact(0)), Hug()
        self.seen_y_m = side * (RADIUS_M + wall_m + seen_off_m)
        self.touches, self.lateral_m, self.wishes = [], [], []

    def scan(self):
        """The wall from where the robot is."""
        with np.errstate(divide="ignore"):
            range_m = (self.seen_y_m - self.now.odom.y_m) / np.sin(self.now.odom.yaw_rad + BEARINGS)
        range_m[(range_m < 0.1) | (range_m > 3.0)] = math.nan
        return Scan(BEARINGS, range_m, np.nan_to_num(range_m, nan=2.0))

    def tick(self):
        now, hug = self.now, self.hug
        now.t_ns += TICK_NS
        if now.t_ns % (5 * TICK_NS) == 0:
            now.gate.sight.see(now.t_ns, now.odom, self.scan())
        y = now.odom.y_m
        touching = self.side * y > self.wall_m
        now.contact = Contact(
            now.t_ns, bump_left=touching and self.side > 0, bump_right=touching and self.side < 0
        )
        if touching:
            if not hug.swinging:
                self.touches.append(now.odom.x_m)
            if not hug.feels(now, y):
                return False
        if hug.swinging:
            wish = hug.swing(now)
            self.wishes.append(wish)
            v, w = wish.v_mps, wish.yaw_rate_radps
        else:
            hug.look(now, y)
            self.lateral_m.append(y)
            v, w = CRUISE_MPS, 4.0 * (math.atan2(hug.aside_m - y, 0.18) - now.odom.yaw_rad)
        if any(isinstance(order, ClearOrder) for order in now.orders):
            now.link = LinkState(now.t_ns, True)
            now.orders.clear()
        now.odom = now.pose = now.odom @ exp(v * 0.02, 0.0, w * 0.02)
        now.driven_m += abs(v) * 0.02
        return True

    def drive(self, until_m):
        while self.now.odom.x_m < until_m and self.now.t_ns < 120e9:
            if not self.tick():
                return False
        return True


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(("wall_m", "seen_off_m"), [(0.03, 0.0), (0.04, -0.02), (0.01, 0.02)])
def test_wherever_the_wall_is_thought_to_be_it_drives_within_a_centimetre_of_it(
    side, wall_m, seen_off_m
):
    along = Along(side, wall_m, seen_off_m)
    assert along.drive(2.5)
    assert 2 <= len(along.touches) <= 10
    half = len(along.lateral_m) // 2
    room_m = wall_m - side * np.array(along.lateral_m[half:])
    assert np.median(room_m) < 0.01 and np.percentile(room_m, 90) < 0.015


def test_it_swings_off_without_a_wheel_pushing_forward_and_faces_its_way_again():
    along = Along(1.0, 0.02)
    while not along.touches:
        along.tick()
    touched = along.now.odom
    along.now.link = LinkState(along.now.t_ns, True, "bump")
    while along.hug.swinging:
        along.tick()
    away = touched.inverse() @ along.now.odom
    assert away.y_m < -0.003 and abs(away.yaw_rad) < 0.1
    half_m = CONFIG.robot.track_width_m / 2.0
    backing = [w for w in along.wishes if w.v_mps < 0.0]
    assert backing and all(w.v_mps + half_m * abs(w.yaw_rate_radps) <= 0.0 for w in backing)
    assert max(abs(w.yaw_rate_radps) for w in backing) * len(backing) * 0.02 >= SWING_RAD


def test_it_never_goes_far_from_its_path():
    along = Along(1.0, 0.15, 0.0)
    along.seen_y_m -= 0.10  # seen near, and not there
    assert along.drive(3.0) and not along.touches
    assert max(along.lateral_m) < ASIDE_M + 0.005


def test_beside_nothing_it_stays_on_its_path():
    along = Along(1.0, 1.0)
    assert along.drive(1.0)
    assert max(map(abs, along.lateral_m)) < 1e-6


def test_to_what_only_the_map_knows_it_comes_no_nearer():
    along = Along(1.0, 1.0)
    along.now.gate.sight.know(np.stack([np.arange(-1, 3, 0.02), np.full(200, RADIUS_M + 0.03)], 1))
    assert along.drive(1.0)
    assert max(map(abs, along.lateral_m)) < 1e-6


def test_the_front_or_nothing_known_beside_it_is_trouble():
    now = situation(CONFIG, Contact(0, bump_left=True, bump_right=True))
    assert not Hug().feels(now, 0.0)
    now.contact = Contact(0, bump_left=True)
    assert not Hug().feels(now, 0.0)
    now.gate.sight.know(np.array([[0.0, RADIUS_M + 0.01]]))
    assert Hug().feels(now, 0.0)
    assert not Hug().feels(now, 1.5 * ASIDE_M)


def test_what_two_touches_show_to_lie_across_its_way_is_trouble():
    for yaw_rad, along in ((0.1, True), (0.8, False)):  # towards a wall along x
        now, hug = situation(CONFIG, Contact(0, bump_left=True)), Hug()
        now.run.touches.appendleft(Touch(SE2(-0.05, 0.0, yaw_rad), 1.0))
        now.odom = now.pose = SE2(0.0, 0.0, yaw_rad)
        now.gate.sight.know(now.odom.apply(np.array([[0.0, RADIUS_M + 0.01]])))
        assert hug.feels(now, 0.0) == along


def test_what_holds_it_fast_is_trouble_after_a_while():
    now = situation(CONFIG, Contact(0, bump_left=True))
    now.gate.sight.know(np.array([[0.0, RADIUS_M + 0.01]]))
    hug = Hug()
    while hug.feels(now, 0.0):
        now.t_ns += TICK_NS
        hug.swing(now)
        assert now.t_ns < 1.1e9 * SWUNG_S
    assert now.t_ns > 0.9e9 * SWUNG_S


def test_round_a_corner_what_was_felt_is_past():
    along = Along(1.0, 0.02)
    while not along.touches or along.hug.swinging:
        along.tick()
    felt_m = along.hug.aside_m
    now = along.now
    now.pose = now.odom = SE2(now.odom.x_m, now.odom.y_m, 1.2)
    now.gate.sight.forget()
    now.t_ns += 200_000_000
    along.hug.look(now, 0.0)
    assert 0.0 <= along.hug.aside_m < 0.8 * felt_m


def test_touched_twice_on_little_way_it_goes_on_slowly_for_a_while():
    now, hug = situation(CONFIG, Contact(0)), Hug()
    now.gate.sight.know(np.array([[0.0, RADIUS_M + 0.01]]))
    wish, speeds_mps = Wish(0.24, 0.6), []
    for driven_m in (1.0, 1.1, 1.3, 1.5):
        now.driven_m, now.contact = driven_m, Contact(now.t_ns, bump_left=driven_m < 1.2)
        if now.touching:
            assert hug.feels(now, 0.0)
            while hug.swinging:  # off and back, on the spot
                now.t_ns += TICK_NS
                now.contact = Contact(now.t_ns)
                turn_rad = hug.swing(now).yaw_rate_radps * 0.02
                now.odom = now.pose = SE2(0.0, 0.0, now.odom.yaw_rad + turn_rad)
        slow = hug.careful(now, wish)
        assert slow.yaw_rate_radps / slow.v_mps == pytest.approx(2.5)  # the same way
        speeds_mps.append(slow.v_mps)
    assert speeds_mps == [0.24, CAREFUL_MPS, CAREFUL_MPS, 0.24]
