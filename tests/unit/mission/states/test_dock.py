"""Docking: what is touched before the dock is seen is backed off from."""

from situations import situation

from robot.config import Config
from robot.messages import ClearOrder, Contact
from robot.mission.states.dock import Dock

CONFIG = Config()


def test_a_touch_while_it_looks_for_the_dock_is_a_failed_try_that_is_backed_off_from():
    now, state = situation(CONFIG, Contact(0, bump_left=True), "bump"), Dock()
    state.enter(now)
    assert state.tick(now).wish.v_mps == 0.0
    assert now.run.dock_tries == 1
    state.tick(now)
    assert any(isinstance(order, ClearOrder) for order in now.orders)
    now.link = situation(CONFIG, Contact(0)).link
    assert state.tick(now).wish.v_mps < 0.0
