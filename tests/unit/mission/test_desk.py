"""The desk numbers its orders and keeps only the answer to the newest."""

import numpy as np

from robot.config import MappingConfig
from robot.geometry.se2 import SE2
from robot.mapping.grid import OccupancyGrid
from robot.mapping.swept import SweptFloor
from robot.messages import Path, Planned
from robot.mission.desk import PlanDesk

NOWHERE = Path(np.zeros((0, 2)))


def desk():
    grid = OccupancyGrid(MappingConfig())
    grid.clear_footprint(SE2(), 0.3)
    return PlanDesk(grid, SweptFloor(MappingConfig(), 0.2))


def test_an_order_carries_the_map_and_the_covered_floor():
    d, orders = desk(), []
    d.order(5, "route", SE2(1.0), orders, SE2(2.0))
    (order,) = orders
    assert order.kind == "route" and order.start == SE2(1.0) and order.goal == SE2(2.0)
    assert order.covered.shape == order.grid.cells.shape and not order.covered.any()
    assert abs(d.known_free_m2 - np.pi * 0.3**2) < 0.02


def test_an_order_tells_where_wheels_slip_if_anybody_knows():
    grid, orders = OccupancyGrid(MappingConfig()), []
    grid.clear_footprint(SE2(), 0.3)
    d = PlanDesk(grid, SweptFloor(MappingConfig(), 0.2))
    d.order(5, "route", SE2(), orders, SE2(2.0))
    grid.feel(SE2(), 0.1, 1.0)
    d.order(6, "route", SE2(), orders, SE2(2.0))
    before, after = orders
    assert before.lost_pct is None
    assert after.lost_pct.shape == after.grid.cells.shape and after.lost_pct.max() == 50


def test_only_the_answer_to_the_newest_order_counts_and_only_once():
    d, orders = desk(), []
    d.order(0, "coverage", SE2(), orders)
    d.order(1_000_000_000, "coverage", SE2(), orders)
    assert d.waiting and d.waited_s(3_000_000_000) == 2.0
    d.planned(Planned(0, orders[0].order_id, NOWHERE, 0.0))
    assert d.waiting and d.take() is None
    d.planned(Planned(0, orders[1].order_id, NOWHERE, 1.5))
    assert not d.waiting and d.take().remaining_m2 == 1.5
    assert d.take() is None


def test_a_dropped_question_has_no_answer():
    d, orders = desk(), []
    d.order(0, "coverage", SE2(), orders)
    d.drop()
    d.planned(Planned(0, orders[0].order_id, NOWHERE, 0.0))
    assert d.take() is None and not d.waiting
