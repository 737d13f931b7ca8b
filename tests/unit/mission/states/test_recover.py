"""Recovery backs off, turns away, and turns out of a corner when backing does not help."""

import math

import numpy as np
import pytest
from situations import situation

from robot.config import Config
from robot.control.safety import Verdict
from robot.geometry.se2 import SE2, exp
from robot.messages import ClearOrder, Contact, Grid, LinkState, PlanOrder, Scan
from robot.mission.ladder import RUNGS, WIGGLE_FROM
from robot.mission.states.recover import Recover
from robot.mission.states.rest import Idle

CONFIG = Config()
TICK_NS = 20_000_000


class Life:
    """Just enough of a robot: wishes become motion, unless the world holds it."""

    def __init__(self, contact, stop="bump", held=False, resume=None):
        self.held, self.wishes, self.step = held, [], None
        self.resume = resume or Idle()
        self.now = situation(CONFIG, contact, stop)

    def recover(self, kind, max_s=30.0):
        state = Recover(kind, self.resume)
        state.enter(self.now)
        while self.step is None and self.now.t_ns < max_s * 1e9:
            now = self.now
            now.t_ns += TICK_NS
            step = state.tick(now)
            self.wishes.append(step.wish)
            if any(isinstance(o, ClearOrder) for o in now.orders):
                now.link = LinkState(now.t_ns, True)
            if step.then is not None:
                self.step = step
            motion = exp(step.wish.v_mps * 0.02, 0.0, step.wish.yaw_rate_radps * 0.02)
            if self.held:
                motion = SE2(0.0, 0.0, motion.yaw_rad)
            now.odom = now.pose = now.odom @ motion
            now.driven_m += abs(motion.x_m)
            if abs(now.odom.yaw_rad) > 0.4 or now.odom.x_m < -0.02:
                now.contact = Contact(now.t_ns)  # released
        return state


def occupied(grid: Grid) -> np.ndarray:
    ys, xs = np.nonzero(grid.cells >= 50)
    res = grid.resolution_m
    return np.stack(
        [(xs + 0.5) * res + grid.origin_x_m, (ys + 0.5) * res + grid.origin_y_m], axis=-1
    )


@pytest.mark.parametrize(("left", "sign"), [(True, -1.0), (False, 1.0)])
def test_a_bump_is_cleared_marked_backed_off_from_and_turned_away_from(left, sign):
    life = Life(Contact(0, bump_left=left, bump_right=not left))
    life.recover("bump")
    assert sum(isinstance(o, ClearOrder) for o in life.now.orders) == 1
    assert life.step.then is life.resume
    assert -CONFIG.mission.back_off_m < life.now.odom.x_m < -0.02
    assert 0.1 < sign * life.now.odom.yaw_rad < 0.4
    marked = occupied(life.now.grid.snapshot())
    assert len(marked) and np.all(np.hypot(*marked.T) > CONFIG.robot.radius_m - 0.02)
    assert np.all(np.sign(marked[:, 1]) == (1 if left else -1))


def test_a_bump_with_the_front_is_backed_off_from_farther():
    life = Life(Contact(0, bump_left=True, bump_right=True))
    life.recover("bump")
    assert life.now.odom.x_m == pytest.approx(-CONFIG.mission.back_off_m, abs=0.02)
    assert abs(life.now.odom.yaw_rad) > 0.3


def test_a_brushed_wall_is_moved_to_where_it_was_touched():
    life = Life(Contact(0, bump_left=True))
    x = np.arange(-0.6, 0.6, 0.02)
    wall = np.stack([x, np.full_like(x, CONFIG.robot.radius_m + 0.04)], axis=-1)
    life.now.grid.mark_obstacle(wall)
    life.now.view = life.now.grid.snapshot()
    life.recover("bump")
    marked = occupied(life.now.grid.snapshot())
    for at in (-0.2, 0.0, 0.2):  # along the wall, too
        assert min(y for x, y in marked if abs(x - at) < 0.05) < CONFIG.robot.radius_m + 0.02
    far = [y for x, y in marked if abs(x) > 0.4]
    assert min(far) > CONFIG.robot.radius_m + 0.02


def test_it_does_not_back_into_what_stands_behind_unless_something_holds_it_in_front():
    for held, least_m, most_m in ((False, 0.0, 0.04), (True, 0.05, 0.35)):
        life = Life(Contact(0, bump_left=True, bump_right=True), held=held)
        life.now.gate.verdict = Verdict(free_m=0.0)
        life.recover("bump")
        backed_m = -sum(w.v_mps for w in life.wishes if w.reason == "backing off") * 0.02
        assert least_m <= backed_m <= most_m


@pytest.mark.parametrize(("left", "sign"), [(True, -1.0), (False, 1.0)])
def test_wedged_in_a_corner_it_turns_out_without_a_wheel_pushing_forward(left, sign):
    life = Life(Contact(0, bump_left=left, bump_right=not left), held=True)
    life.recover("bump")
    pivots = [w for w in life.wishes if w.reason == "turning out of a corner"]
    assert pivots and all(sign * w.yaw_rate_radps > 0.0 for w in pivots)
    half = CONFIG.robot.track_width_m / 2.0
    assert all(w.v_mps + half * abs(w.yaw_rate_radps) <= 0.0 for w in pivots)
    assert life.step.then is life.resume and not life.now.touching


def test_tries_without_progress_escalate_to_the_own_trail_and_then_give_up():
    names = []
    life = Life(Contact(0, bump_left=True))
    for k in range(20):
        life.now.run.trail.drop_crumb(SE2(-0.06 * k))
    for _ in range(12):
        life.step, life.now.contact = None, Contact(0, bump_left=True)
        life.now.odom = life.now.pose = SE2()
        life.now.run.trouble.over_at_m = life.now.driven_m
        life.recover("bump", max_s=1e6)
        names.append(life.step.then.name)
    limit = CONFIG.mission.recover_tries
    assert names[:2] == ["idle", "idle"] and names[2] == "retrace"
    assert set(names[limit:]) == {"error"} and "gave up" in life.step.reason


@pytest.mark.parametrize(
    ("over_s", "away_m", "swept_m2", "first"),
    [(1, 0.1, 0.0, False), (1, 0.8, 0.0, True), (20, 0.1, 0.0, True), (1, 0.1, 0.2, True)],
)
def test_free_driving_makes_the_next_trouble_a_first_one(over_s, away_m, swept_m2, first):
    life = Life(Contact(0, bump_left=True))
    run = life.now.run
    run.trouble.tries, run.trouble.over_at_m, run.trouble.place = 2, 0.0, SE2(away_m)
    run.trouble.over_ns, run.trouble.swept_m2 = life.now.t_ns - over_s * 10**9, -swept_m2
    life.recover("bump")
    assert life.now.run.trouble.tries == (1 if first else 3)


def test_where_wheels_were_held_before_a_line_across_the_way_is_marked():
    life = Life(Contact(0), stop="stall")
    wide_m = []
    for _ in range(3):
        life.step, life.now.link = None, LinkState(0, True, "stall")
        life.now.odom = life.now.pose = SE2()
        life.recover("stop")
        y = occupied(life.now.grid.snapshot())[:, 1]
        wide_m.append(float(np.ptp(y)) if len(y) else 0.0)
    assert wide_m[0] == 0.0 and 0.2 < wide_m[1] < 0.4 and 0.5 < wide_m[2] < 0.7


def test_what_is_touched_again_and_again_is_marked_wider_each_time():
    life = Life(Contact(0))
    wide_m = []
    for _ in range(4):
        life.step, life.now.contact = None, Contact(0, bump_left=True, bump_right=True)
        life.now.odom = life.now.pose = SE2()
        life.recover("bump")
        wide_m.append(float(np.ptp(occupied(life.now.grid.snapshot())[:, 1])))
    assert wide_m == sorted(wide_m) and wide_m[0] < 0.1 and 0.3 < wide_m[-1] < 0.5


def test_a_slanted_thing_that_nobody_sees_is_marked_as_it_lies():
    """Its bumper meets a wall along x with 40 degrees between way and wall, and then once more."""
    life, yaw_rad = Life(Contact(0)), 0.7
    for x_m in (0.0, 0.06):
        life.step, life.now.contact = None, Contact(0, bump_left=True)
        life.now.odom = life.now.pose = SE2(x_m, 0.0, yaw_rad)
        before = {tuple(p) for p in occupied(life.now.grid.snapshot())}
        Recover("bump", life.resume).enter(life.now)
    new = [p for p in map(tuple, occupied(life.now.grid.snapshot())) if p not in before]
    x, y = np.array(new).T
    assert np.ptp(x) > 0.1 and np.ptp(y) < 0.03
    assert abs(y.mean() - CONFIG.robot.radius_m) < 0.03 and -0.1 < x.mean() < 0.15


def test_what_the_eyes_see_before_it_is_marked_only_where_it_stands_twice():
    life = Life(Contact(0), stop="")
    ahead_m = np.full(9, CONFIG.robot.radius_m + 0.02)
    life.now.gate.sight.see(0, SE2(), Scan(np.linspace(-0.2, 0.2, 9), ahead_m, ahead_m))
    counts = []
    for _ in range(2):
        life.step, life.now.odom, life.now.pose = None, SE2(), SE2()
        life.recover("blocked")
        counts.append(len(occupied(life.now.grid.snapshot())))
    assert counts[0] == 0 and counts[1] > 0


def test_work_between_two_touches_is_no_time_of_trouble():
    for kind, ends in (("bump", "idle"), ("blocked", "idle"), ("slip", "error")):
        life = Life(Contact(0, bump_left=True))
        life.recover(kind)
        life.now.t_ns += 40 * 10**9  # 40 s, but not far away, and nothing swept
        life.step, life.now.contact = None, Contact(0, bump_left=True)
        life.now.run.trouble.over_at_m = life.now.driven_m
        life.recover("bump", max_s=1e6)
        assert life.step.then.name == ends


def test_a_cliff_is_marked_across_the_way():
    life = Life(Contact(0, cliff=True), stop="cliff")
    life.recover("cliff")
    bearing = np.arctan2(*occupied(life.now.grid.snapshot()).T[::-1])
    assert bearing.min() < -0.6 and bearing.max() > 0.6
    assert life.now.odom.x_m < -0.1


@pytest.mark.parametrize(("sensors", "side"), [(0b0001, 1.0), (0b0011, 1.0), (0b1000, -1.0)])
def test_an_edge_is_marked_where_no_floor_is_seen_and_turned_away_from(sensors, side):
    life = Life(Contact(0, cliff=True, cliff_sensors=sensors), stop="cliff")
    life.recover("cliff")
    bearing = side * np.arctan2(*occupied(life.now.grid.snapshot()).T[::-1])
    assert bearing.min() > -0.05 and bearing.max() > 0.8
    assert side * life.now.odom.yaw_rad < -0.2


def test_a_stop_that_cannot_be_cleared_is_an_error():
    life = Life(Contact(0), stop="stall")
    life.now.orders = Deaf()
    life.recover("stop")
    assert life.step.then.name == "error" and "stall" in life.step.reason
    assert life.now.t_ns * 1e-9 < 6.0


class Deaf(list):
    """Orders that nobody hears."""

    def __iter__(self):
        return iter(())


def test_an_open_question_to_the_planner_is_dropped():
    life = Life(Contact(0, bump_left=True))
    life.now.desk.order(0, "coverage", SE2(), life.now.orders)
    assert any(isinstance(o, PlanOrder) for o in life.now.orders)
    life.recover("bump")
    assert not life.now.desk.waiting and math.isfinite(life.now.odom.x_m)


@pytest.mark.parametrize("kind", ["bump", "stop", "slip", "stuck", "blocked", "enclosed"])
def test_every_rung_is_left_in_time_although_nothing_moves(kind):
    for tries in range(CONFIG.mission.recover_tries):
        life = Life(Contact(0), stop="")
        life.now.run.trouble.tries, life.now.run.trouble.over_at_m = tries, life.now.driven_m
        state, entered = Recover(kind, life.resume), {}
        life.held = True
        state.enter(life.now)
        since_ns, phase = life.now.t_ns, state._phase
        while life.step is None:
            life.now.t_ns += TICK_NS
            step = state.tick(life.now)
            if state._phase != phase or step.then is not None:
                entered[phase] = (life.now.t_ns - since_ns) * 1e-9
                since_ns, phase = life.now.t_ns, state._phase
            life.step = step if step.then is not None else None
        for name, took_s in entered.items():
            assert took_s <= RUNGS[name].limit_s + 0.1, (kind, tries, name)
        if kind in ("stop", "slip", "stuck"):
            assert ("wiggle" in entered) == (tries + 1 >= WIGGLE_FROM)


def test_a_trouble_ends_after_its_time_and_after_its_way_and_names_the_cause():
    for spent in ({"since_ns": -36 * 10**9}, {"back_m": 1.5}):
        life = Life(Contact(0, bump_left=True, bump_right=True), stop="bump")
        life.now.run.trouble.tries, life.now.run.trouble.over_at_m = 2, life.now.driven_m
        for name, value in spent.items():
            setattr(life.now.run.trouble, name, value)
        life.recover("bump")
        assert life.step.then.name == "error" and "bumper stays pressed" in life.step.reason


def test_a_stall_is_named_as_a_wheel():
    life = Life(Contact(0), stop="stall")
    life.now.run.trouble.tries, life.now.run.trouble.over_at_m = 8, life.now.driven_m
    life.recover("stop")
    assert "a wheel is blocked" in life.step.reason and "gave up after 8 tries" in life.step.reason


def test_the_cause_is_named_although_the_last_try_met_something_else():
    for kind, stop, words in (("stop", "stall", "a wheel is blocked"), ("slip", "", "slippery")):
        life = Life(Contact(0), stop=stop)
        life.recover(kind)
        life.step, life.now.contact = None, Contact(0, bump_left=True)
        life.now.run.trouble.tries, life.now.run.trouble.over_at_m = 8, life.now.driven_m
        life.recover("bump")
        assert words in life.step.reason


def test_backing_off_in_one_trouble_is_bounded_in_metres():
    life = Life(Contact(0), stop="stall")
    backed_m = 0.0
    for _ in range(CONFIG.mission.recover_tries + 1):
        life.step, before_m = None, life.now.driven_m
        life.now.run.trouble.over_at_m, life.now.link = (
            life.now.driven_m,
            LinkState(0, True, "stall"),
        )
        life.now.run.trouble.since_ns = life.now.t_ns
        life.recover("stop", max_s=1e6)
        backed_m += life.now.driven_m - before_m
    assert life.step.then.name == "error"
    assert life.now.run.trouble.back_m <= CONFIG.mission.recover_limit_m + 0.02


def test_closed_in_by_its_own_marks_it_forgets_them():
    life = Life(Contact(0), stop="")
    life.now.grid.mark_obstacle(np.array([[0.0, 0.45]]))
    assert len(occupied(life.now.grid.snapshot()))
    life.recover("enclosed")
    assert len(occupied(life.now.grid.snapshot())) == 0
