"""Put down somewhere, or lost: it looks round, also with something beside it."""

import pytest

from robot.config import Config
from robot.control.safety import SafetyGate
from robot.geometry.se2 import SE2, exp
from robot.mapping.grid import OccupancyGrid
from robot.mapping.swept import SweptFloor
from robot.messages import Contact, LinkState
from robot.mission.desk import PlanDesk
from robot.mission.dock_sight import DockSight
from robot.mission.state import Situation
from robot.mission.states.lifted import Lost
from robot.mission.states.rest import Idle

CONFIG = Config()
TICK_NS = 20_000_000


def situation():
    grid = OccupancyGrid(CONFIG.mapping)
    swept = SweptFloor(CONFIG.mapping, CONFIG.robot.brush_width_m)
    return Situation(
        t_ns=0, pose=SE2(), yaw_sigma_rad=0.01, health="lost", odom=SE2(), driven_m=5.0,
        turned_rad=0.0, contact=Contact(0), link=LinkState(0, True), battery_pct=80.0,
        view=grid.snapshot(), known_free_m2=1.0, grid=grid, swept=swept,
        gate=SafetyGate(CONFIG.control, CONFIG.robot), desk=PlanDesk(grid, swept),
        sight=DockSight(CONFIG.robot), robot=CONFIG.robot, control=CONFIG.control,
        config=CONFIG.mission, recognised=0.0,
    )  # fmt: skip


def live(now, state, *, pressed=lambda now: False, max_s=40.0):
    """Ticks until another state is wished; with the bumper pressed only backing moves the robot."""
    state.enter(now)
    while now.t_ns < max_s * 1e9:
        now.t_ns += TICK_NS
        left = pressed(now)
        now.contact = Contact(now.t_ns, bump_left=left)
        step = state.tick(now)
        if step.then is not None:
            return step
        if left and step.wish.v_mps >= 0.0:
            continue
        motion = exp(step.wish.v_mps * 0.02, 0.0, step.wish.yaw_rate_radps * 0.02)
        now.odom = now.pose = now.odom @ motion
        now.turned_rad += abs(motion.yaw_rad)
    raise AssertionError("it never ended")


def test_a_place_that_is_recognised_is_gone_on_from():
    now, resume = situation(), Idle()
    now.health, now.recognised = "ok", 0.9
    assert live(now, Lost(resume)).then is resume


def test_after_a_turn_that_shows_the_same_things_it_stays_where_it_was():
    now, resume, settled = situation(), Idle(), []
    now.recognised, now.settle = 0.8, lambda: settled.append(now.turned_rad)
    assert live(now, Lost(resume)).then is resume
    assert settled and settled[0] > 5.0


def test_it_gives_up_where_nothing_is_known():
    step = live(situation(), Lost(Idle()))
    assert "does not recognise" in step.reason or "does not recognise" in str(vars(step.then))


def test_a_wall_that_it_touches_while_turning_does_not_hold_it():
    now = situation()
    touches = lambda now: now.odom.x_m > -0.03 and 0.4 < now.odom.yaw_rad % 6.283 < 3.0  # noqa: E731
    live(now, Lost(Idle()), pressed=touches)
    assert now.turned_rad == pytest.approx(4 * 3.1416, abs=0.3)
