"""Plans on maps drawn by hand and by chance: they clean, keep clear, look, and say why not."""

from __future__ import annotations

import math
from itertools import pairwise

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.config import PlanningConfig, RobotConfig
from robot.geometry.se2 import SE2
from robot.messages import Grid, Planned, PlanOrder
from robot.planning.worker import plan

PLANNING, ROBOT = PlanningConfig(), RobotConfig()
CELL_M = 0.025


def room(width_m: float = 3.0, height_m: float = 2.0) -> np.ndarray:
    cells = np.zeros((round(height_m / CELL_M), round(width_m / CELL_M)), np.int8)
    cells[[0, -1], :] = cells[:, [0, -1]] = 100
    return cells


def box(cells: np.ndarray, x0: float, y0: float, x1: float, y1: float, value: int = 100) -> None:
    s = 1.0 / CELL_M
    cells[round(y0 * s) : round(y1 * s), round(x0 * s) : round(x1 * s)] = value


def ask(cells, start, kind="coverage", goal=None, covered=None, lost_pct=None) -> Planned:
    grid = Grid(CELL_M, 0.0, 0.0, cells)
    covered = np.zeros(cells.shape, bool) if covered is None else covered
    order = PlanOrder(5, 7, kind, grid, covered, start, goal, lost_pct=lost_pct)
    return plan(order, PLANNING, ROBOT)


def along(points_m: np.ndarray) -> np.ndarray:
    """A polyline (n, 2) in steps of at most a centimetre."""
    legs = []
    for a, b in pairwise(points_m):
        count = max(2, math.ceil(math.hypot(*(b - a)) / 0.01))
        legs.append(a + np.linspace(0.0, 1.0, count)[:, None] * (b - a))
    return np.vstack(legs)


def clearance_m(cells: np.ndarray, points_m: np.ndarray) -> np.ndarray:
    """From each point (n, 2) to the nearest matter's edge."""
    far = cv2.distanceTransform((cells < 50).astype(np.uint8), cv2.DIST_L2, 5)
    at = (points_m / CELL_M).astype(int)
    return (far[at[:, 1], at[:, 0]] - 0.5) * CELL_M


def swept(cells: np.ndarray, points_m: np.ndarray) -> np.ndarray:
    """Cells that a disc of the brush's width passes over."""
    mask = np.zeros(cells.shape, np.uint8)
    for x, y in points_m / CELL_M:
        cv2.circle(mask, (int(x), int(y)), round(ROBOT.brush_width_m / 2 / CELL_M), 1, -1)
    return mask > 0


def test_a_room_is_cleaned_in_one_plan_and_then_there_is_nothing_left():
    cells = room()
    start = SE2(0.5, 0.5)
    first = ask(cells, start)
    assert (first.t_ns, first.order_id) == (5, 7)
    np.testing.assert_allclose(first.path.points_m[0], (0.5, 0.5), atol=1e-6)
    edge_m = ROBOT.radius_m - ROBOT.brush_width_m / 2.0
    assert first.remaining_m2 == pytest.approx((3.0 - 2 * edge_m) * (2.0 - 2 * edge_m), rel=0.08)
    done = swept(cells, along(first.path.points_m))
    then = ask(cells, start, covered=done)
    assert then.remaining_m2 < 0.05 * first.remaining_m2
    assert first.reached_m2 == 0.0 and then.reached_m2 > 0.95 * first.remaining_m2
    assert len(ask(cells, start, covered=np.ones(cells.shape, bool)).path.points_m) == 0


@settings(max_examples=20, deadline=None)
@given(
    st.lists(st.tuples(st.floats(0.9, 2.6), st.floats(0.9, 2.1), st.floats(0.05, 0.4)), max_size=4),
    st.floats(-math.pi, math.pi),
)
def test_no_plan_leads_the_robot_into_matter(things, yaw_rad):
    cells = room(3.2, 2.6)
    for x, y, side in things:
        box(cells, x, y, x + side, y + side)
    answer = ask(cells, SE2(0.45, 0.45, yaw_rad))
    assert len(answer.path.points_m) > 2 and answer.remaining_m2 > 1.0
    assert clearance_m(cells, along(answer.path.points_m)).min() > ROBOT.radius_m - 0.03
    np.testing.assert_array_equal(
        answer.path.points_m, ask(cells, SE2(0.45, 0.45, yaw_rad)).path.points_m
    )


def test_unknown_floor_is_kept_away_from_and_looked_at():
    cells = room(4.0, 2.0)
    box(cells, 2.0, 0.1, 3.9, 1.9, -1)
    answer = ask(cells, SE2(0.5, 0.5))
    assert answer.path.points_m[:, 0].max() < 2.0
    looks = ask(cells, SE2(0.5, 0.5), covered=cells == 0)
    last, before = looks.path.points_m[-1], looks.path.points_m[-2]
    assert looks.reason == "look at unseen floor"
    assert last[0] > 1.5 and last[0] - before[0] > 0.0


def test_a_route_goes_round_and_ends_at_its_goal():
    cells = room(3.0, 2.0)
    box(cells, 1.4, 0.0, 1.6, 1.4)
    start, goal = SE2(0.6, 0.4), SE2(2.4, 0.4)
    answer = ask(cells, start, "route", goal)
    points = answer.path.points_m
    np.testing.assert_allclose(points[[0, -1]], [(0.6, 0.4), (2.4, 0.4)], atol=0.02)
    assert points[:, 1].max() > 1.4 + ROBOT.radius_m - 0.03
    assert clearance_m(cells, along(points)).min() > ROBOT.radius_m - 0.03


def test_a_goal_beside_matter_is_approached_and_a_walled_in_one_refused():
    cells = room(3.0, 2.0)
    beside = ask(cells, SE2(0.6, 0.6), "route", SE2(2.95, 1.0))
    assert 0.0 < 2.95 - beside.path.points_m[-1, 0] < 0.30
    box(cells, 1.4, 0.0, 1.6, 2.0)
    for goal, reason in ((SE2(2.4, 1.0), "cannot be reached"), (None, "no goal")):
        refused = ask(cells, SE2(0.6, 0.6), "route", goal)
        assert len(refused.path.points_m) == 0 and reason in refused.reason
    nowhere = ask(np.full((40, 40), 100, np.int8), SE2(0.5, 0.5))
    assert len(nowhere.path.points_m) == 0 and "fits nowhere" in nowhere.reason


def test_a_speck_far_away_is_not_worth_the_way():
    cells = room(6.0, 2.0)
    covered = np.ones(cells.shape, bool)
    box_of = (slice(40, 46), slice(225, 231))
    covered[box_of] = False  # 0.02 m2, five metres away
    far = ask(cells, SE2(0.5, 0.5), covered=covered)
    near = ask(cells, SE2(5.2, 1.0), covered=covered)
    assert len(far.path.points_m) == 0 and far.remaining_m2 > 0.0
    assert len(near.path.points_m) >= 2


def carpet(cells: np.ndarray, *band: float) -> np.ndarray:
    lost_pct = np.zeros(cells.shape, np.uint8)
    box(lost_pct, *band, value=60)
    return lost_pct


def lost_on(lost_pct: np.ndarray, answer: Planned) -> float:
    """Metres of the path on the carpet."""
    at = (along(answer.path.points_m) / CELL_M).astype(int)
    return np.count_nonzero(lost_pct[at[:, 1], at[:, 0]]) * 0.01


def test_a_route_goes_round_floor_where_wheels_slip():
    cells = room(4.0, 3.0)
    lost_pct = carpet(cells, 1.5, 0.0, 2.5, 1.9)
    start, goal = SE2(0.5, 1.2), SE2(3.5, 1.2)
    assert lost_on(lost_pct, ask(cells, start, "route", goal)) > 0.9
    round_it = ask(cells, start, "route", goal, lost_pct=lost_pct)
    np.testing.assert_allclose(round_it.path.points_m[-1], (3.5, 1.2), atol=1e-6)
    assert lost_on(lost_pct, round_it) == 0.0


def test_a_route_crosses_it_where_there_is_no_other_way_and_straight():
    cells = room(4.0, 2.0)
    lost_pct = carpet(cells, 1.5, 0.0, 2.5, 2.0)
    answer = ask(cells, SE2(0.5, 0.6), "route", SE2(3.5, 1.4), lost_pct=lost_pct)
    np.testing.assert_allclose(answer.path.points_m[-1], (3.5, 1.4), atol=1e-6)
    assert 0.9 < lost_on(lost_pct, answer) < 1.3


def test_a_carpet_is_swept_like_any_floor():
    cells = room()
    lost_pct = carpet(cells, 1.0, 0.5, 2.0, 1.5)
    answer = ask(cells, SE2(0.5, 0.5), lost_pct=lost_pct)
    done = swept(cells, along(answer.path.points_m))
    assert done[lost_pct > 0].mean() > 0.99
