"""Who has swept the floor came by it: if it is out of reach, the robot is closed in."""

import numpy as np
import pytest
from situations import situation

from robot.config import Config
from robot.geometry.se2 import SE2
from robot.messages import Contact, Path, Planned
from robot.mission.states.clean import Clean

CONFIG = Config()
PATH = Path(np.array([[0.0, 0.0], [1.0, 0.0]]))


@pytest.mark.parametrize(
    ("swept_m", "reached_m2", "closed_in"),
    [(10.0, 1.8, False), (10.0, 0.2, True), (1.0, 0.0, False), (10.0, np.nan, False)],
    ids=["in the open", "closed in", "at the beginning", "from an old log"],
)
def test_closed_in_is_who_reaches_little_of_what_was_swept(swept_m, reached_m2, closed_in):
    now, state = situation(CONFIG, Contact(0)), Clean()
    for x_m in np.arange(0.0, swept_m, 0.02):
        now.swept.sweep(SE2(float(x_m)))
    state.enter(now)
    now.t_ns += 20_000_000
    order_id = now.orders[-1].order_id
    now.desk.planned(Planned(now.t_ns, order_id, PATH, 3.0, "sweep", reached_m2=reached_m2))
    step = state.tick(now)
    assert (step.then is not None and step.then.name == "recover") is closed_in
    assert now.run.due_m2 == pytest.approx(now.swept.area_m2 + 3.0)
