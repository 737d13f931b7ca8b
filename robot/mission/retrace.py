"""Going back the way the robot came: the way out when the map sees none."""

from __future__ import annotations

import numpy as np

from robot.control.follow import Follower
from robot.control.wish import Wish
from robot.messages import Path
from robot.mission.ladder import RETRACE
from robot.mission.state import Situation, State, Step, seconds

SPEED_MPS = 0.12


class Retrace(State):
    """Follows its own trail back for some distance, then `resume` goes on with a new plan."""

    name = "retrace"

    def __init__(self, distance_m: float, resume: State) -> None:
        self._distance_m = min(distance_m, RETRACE.limit_m)
        self._resume = resume
        self._follower: Follower | None = None

    @property
    def after_trouble(self) -> State:
        """Its own way has failed as well: a new plan."""
        return self._resume

    def enter(self, now: Situation) -> None:
        self._since_ns = now.t_ns
        here = np.array([[now.odom.x_m, now.odom.y_m]])
        points = np.vstack([here, now.run.trail.back(self._distance_m)])
        now.run.trail.cut(self._distance_m)
        self._follower = Follower(Path(points), now.odom, now.control, now.robot, SPEED_MPS)

    def tick(self, now: Situation) -> Step:
        follower = self._follower
        late = seconds(self._since_ns, now.t_ns) > RETRACE.limit_s
        if follower is None or follower.done or late:
            now.run.trouble.over_ns = now.t_ns
            return Step(then=self._resume, reason="back where it came from, making a new plan")
        steering = follower.steer(now.odom)
        return Step(Wish(steering.v_mps, steering.yaw_rate_radps, reason="going back its own way"))
