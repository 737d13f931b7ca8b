"""The ladder out of trouble: its rungs, each bounded in time and in distance.

A trouble begins with the first recovery after free driving and ends when the robot has driven
freely for `mission.recover_reset_m` and got away from the place, had peace, or got work done.
Within one trouble every try climbs higher: it backs off farther and turns more, then wiggles, then
goes back the way it came; after each try the plan is made anew. The whole trouble is bounded by
`recover_tries`, `recover_limit_s` and `recover_limit_m`; then the robot gives up and says why.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from robot.mission.state import Situation, seconds

Kind = Literal["bump", "cliff", "blocked", "stuck", "enclosed", "stop", "slip"]
Phase = Literal["wait", "clear", "back", "pivot", "turn", "wiggle"]


@dataclass(frozen=True, slots=True)
class Rung:
    """What one step may take at most."""

    limit_s: float
    limit_m: float


RUNGS: dict[Phase, Rung] = {
    "wait": Rung(1.5, 0.0),  # who stands in the way may go
    "clear": Rung(4.0, 0.0),  # the motor controller lets go of its stop
    "back": Rung(4.0, 0.30),
    "pivot": Rung(4.0, 0.15),
    "turn": Rung(4.0, 0.10),
    "wiggle": Rung(5.0, 0.40),
}
WIGGLE_FROM, RETRACE_FROM = 3, 3  # tries
RETRACE = Rung(15.0, 2.0)
CLOSED_IN_S = 30.0  # a whole trouble, where no way leads on: there is little to try
SAYS: dict[Kind, str] = {
    "bump": "touched something",
    "cliff": "came to a cliff",
    "blocked": "found its way blocked",
    "stuck": "does not get on although it tries",
    "enclosed": "sees no way on",
    "stop": "was stopped by the motor controller",
    "slip": "does not move although its wheels turn",
}


def back_off_m(now: Situation, kind: Kind, tries: int) -> float:
    """How far this try backs off."""
    wished_m = now.config.back_off_m * (1.0 + 0.5 * (tries - 1))
    if kind == "cliff":
        wished_m *= 1.5
    left_m = now.config.recover_limit_m - now.run.trouble.back_m
    return max(0.0, min(wished_m, RUNGS["back"].limit_m, left_m))


def exhausted(now: Situation, kind: Kind, tries: int, stop: str) -> str:
    """Why the robot gives up now, empty while it may try on."""
    run, config = now.run, now.config
    took_s = seconds(run.trouble.since_ns, now.t_ns)
    limit_s = config.recover_limit_s
    if "enclosed" in run.trouble.kinds:
        limit_s = min(limit_s, CLOSED_IN_S)
    over = tries > config.recover_tries or took_s > limit_s
    if not over and run.trouble.back_m < config.recover_limit_m - 0.01:
        return ""
    done = max(1, tries - 1)
    how = f"gave up after {done} {'try' if done == 1 else 'tries'} in {took_s:.0f} s"
    return f"the robot {SAYS[kind]}, {how}: {_cause(now, kind, stop + run.trouble.stop)}"


def _cause(now: Situation, kind: Kind, stop: str) -> str:
    """What a person should look for."""
    if "stall" in stop:
        return "a wheel is blocked; take out what holds it"
    if "current" in stop:
        return "a motor draws too much; take out what holds it"
    kinds = now.run.trouble.kinds
    if "slip" in kinds:
        return "its wheels turn on a slippery floor or it hangs on something; carry it a step away"
    if "enclosed" in kinds or "blocked" in kinds:
        return "it is closed in; open a way for it"
    if now.touching:
        return "its bumper stays pressed; free it"
    if kind == "cliff":
        return "it stands at an edge; carry it a step away"
    return "something holds it; carry it a step away"
