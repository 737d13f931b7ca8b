"""Put down somewhere, or lost: it looks round, also with something beside it."""

import pytest
from situations import situation

from robot.config import Config
from robot.geometry.se2 import exp
from robot.messages import Contact
from robot.mission.states.lifted import Lifted, Lost
from robot.mission.states.rest import Idle

CONFIG = Config()
TICK_NS = 20_000_000


def lost():
    now = situation(CONFIG, Contact(0))
    now.health, now.recognised, now.recognised_round = "lost", 0.0, 0.0
    return now


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
    now, resume = lost(), Idle()
    now.health, now.recognised = "ok", 0.9
    assert live(now, Lost(resume)).then is resume


@pytest.mark.parametrize(
    ("state", "share", "round_about", "settles"),
    [
        (Lost, 0.8, 0.5, True),
        (Lost, 0.8, 0.3, False),
        (Lost, 0.6, 0.9, False),
        (Lifted, 0.8, 0.8, True),
        (Lifted, 0.8, 0.5, False),
    ],
)
def test_after_a_turn_that_shows_the_same_things_it_stays_where_it_was(
    state, share, round_about, settles
):
    now, resume, settled = lost(), Idle(), []
    now.recognised, now.recognised_round = share, round_about
    now.settle = lambda: settled.append(now.turned_rad)
    step = live(now, state(resume))
    assert bool(settled) is settles and (step.then is resume) is settles
    assert not settled or settled[0] > 5.0


def test_it_gives_up_where_nothing_is_known():
    step = live(lost(), Lost(Idle()))
    assert "does not recognise" in step.reason


def test_a_wall_that_it_touches_while_turning_does_not_hold_it():
    now = lost()
    touches = lambda now: now.odom.x_m > -0.03 and 0.4 < now.odom.yaw_rad % 6.283 < 3.0  # noqa: E731
    live(now, Lost(Idle()), pressed=touches)
    assert now.turned_rad == pytest.approx(4 * 3.1416, abs=0.3)
