"""Work that vanishes between two plans is noticed, work that was done is not missed."""

import numpy as np
import pytest
from situations import situation

from robot.config import Config
from robot.geometry.se2 import SE2
from robot.messages import Contact, Path, Planned
from robot.mission.states.clean import Clean

CONFIG = Config()


def plan(state: Clean, now, remaining_m2: float):
    """The next answer of the planner, and what the state makes of it."""
    now.t_ns += 20_000_000
    path = Path(np.array([[0.0, 0.0], [1.0, 0.0]]))
    now.desk.planned(Planned(now.t_ns, now.desk._order_id, path, remaining_m2, "sweep"))
    return state.tick(now)


def sweep(now, ahead_m: float) -> None:
    for x_m in np.arange(0.0, ahead_m, 0.02):
        now.swept.sweep(SE2(float(x_m)))


@pytest.mark.parametrize(("swept_m", "left_m2", "closed_in"), [(0, 0.1, True), (10, 0.8, False)])
def test_after_a_touch_only_work_that_was_not_done_is_missed(swept_m, left_m2, closed_in):
    now, state = situation(CONFIG, Contact(0)), Clean()
    state.enter(now)
    assert plan(state, now, remaining_m2=3.0).then is None
    sweep(now, swept_m)
    state.enter(now)  # back from a recovery
    step = plan(state, now, left_m2)
    assert (step.then is not None and step.then.name == "recover") is closed_in


def test_closed_in_work_is_believed_to_be_gone_after_some_tries():
    now, state = situation(CONFIG, Contact(0)), Clean()
    state.enter(now)
    plan(state, now, remaining_m2=3.0)
    names = []
    for _ in range(4):
        state.enter(now)
        then = plan(state, now, remaining_m2=0.1).then
        names.append(None if then is None else then.name)
    assert names == ["recover", "recover", "recover", None]
