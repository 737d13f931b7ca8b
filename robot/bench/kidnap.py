"""`sweeper bench kidnap`: a robot that knows its home is carried elsewhere, again and again.

Every second time it is lifted (its wheels drop), else it is moved between two frames and told by
nothing. Measured: how soon it says that it is lost, how soon it knows where it is, and whether it
ever was sure of a wrong place; who sees nothing familiar and says so (`degraded`) is not sure.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from robot.bench.trial import Trial
from robot.config import Config
from robot.geometry.se2 import wrap_angle
from robot.home import Home

CALM_S = 12.0  # of knowing where it is, before it is carried away
AIR_S = 2.0
LIMIT_S = 45.0  # then it will not find itself any more
RIGHT_M, RIGHT_RAD = 0.3, 0.3
DETECT_S = 5.0  # an unnoticed carry may stay unnoticed for so long


@dataclass
class Carry:
    """One time that somebody took the robot; seconds since it stood on the floor again."""

    lifted: bool
    down_s: float
    detected_s: float | None = None
    found_s: float | None = None
    wrong_s: float = 0.0  # spent sure of a wrong place, beyond what detection may take

    def row(self) -> dict[str, Any]:
        """As JSON."""
        return {
            "lifted": self.lifted,
            "detected_s": _rounded(self.detected_s),
            "found_s": _rounded(self.found_s),
            "wrong_s": _rounded(self.wrong_s),
        }


@dataclass
class _Script:
    """Carries the robot, and watches what it believes."""

    wanted: int
    carries: list[Carry] = field(default_factory=list)
    in_air_s: float | None = None
    sure_since_s: float = math.inf
    read: int = 0

    def __call__(self, trial: Trial, t_s: float) -> None:
        self._watch(trial)
        now = self.carries[-1] if self.carries else None
        if self.in_air_s is not None:
            if t_s - self.in_air_s >= AIR_S:
                self.in_air_s = None
                self._put(trial, t_s, lifted=True)
            return
        if now is not None and now.found_s is None and t_s - now.down_s < LIMIT_S:
            return
        if len(self.carries) >= self.wanted:
            trial.end_s = t_s
        elif trial.state in ("error", "idle", "done", "docked"):
            self._begin_again(trial, t_s)
        elif t_s - self.sure_since_s >= CALM_S:
            self._carry(trial, t_s)

    def _carry(self, trial: Trial, t_s: float) -> None:
        if len(self.carries) % 2 == 0:
            trial.base.lift()
            self.in_air_s = t_s
        else:
            self._put(trial, t_s, lifted=False)

    def _put(self, trial: Trial, t_s: float, lifted: bool) -> None:
        trial.base.carry_to(trial.elsewhere())
        self.sure_since_s = math.inf
        self.carries.append(Carry(lifted, t_s, 0.0 if lifted else None))

    def _begin_again(self, trial: Trial, t_s: float) -> None:
        """It has given up or ended: put it on its dock, and start it."""
        if trial.asked or t_s - self._asked_s < 5.0:
            return
        self._asked_s = t_s
        trial.base.carry_to(trial.world.start)
        trial.ask("start")

    _asked_s: float = -math.inf

    def _watch(self, trial: Trial) -> None:
        for estimate in trial.estimates[self.read :]:
            away = trial.true_at[estimate.t_ns].inverse() @ estimate.world_from_base
            right = math.hypot(away.x_m, away.y_m) < RIGHT_M
            right &= abs(wrap_angle(away.yaw_rad)) < RIGHT_RAD
            self._note(estimate.t_ns * 1e-9, estimate.health, right)
        self.read = len(trial.estimates)

    def _note(self, t_s: float, health: str, right: bool) -> None:
        lost = health == "lost"
        if lost or not right:
            self.sure_since_s = math.inf
        else:
            self.sure_since_s = min(self.sure_since_s, t_s)
        if not self.carries or t_s < self.carries[-1].down_s:
            return
        carry = self.carries[-1]
        since_s = t_s - carry.down_s
        if lost and carry.detected_s is None:
            carry.detected_s = since_s
        if not lost and right and carry.found_s is None and carry.detected_s is not None:
            carry.found_s = since_s
        allowed = carry.detected_s is None and since_s < DETECT_S
        if health == "ok" and not right and not allowed:
            carry.wrong_s += 0.1  # frames come at 10 Hz


def bench_kidnap(
    scene: str, seed: int, carries: int, config: Config, rendered: bool = True
) -> dict[str, Any]:
    """`{"carries": [...], "summary": {...}}`, after one run in which the home was learned."""
    home = _learned(scene, seed, config, rendered)
    script = _Script(carries)
    trial = Trial(config, scene, seed + 1, home=home, rendered=rendered, end_s=math.inf)
    trial.live(script)
    return {"carries": [c.row() for c in script.carries], "summary": _summary(script.carries)}


def _learned(scene: str, seed: int, config: Config, rendered: bool) -> Home:
    trial = Trial(config, scene, seed, rendered=rendered, end_s=1800.0)
    trial.live(lambda trial, t_s: None)
    return trial.brain.home()


def _summary(carries: list[Carry]) -> dict[str, Any]:
    found = [c.found_s for c in carries if c.found_s is not None]
    unnoticed = [c.detected_s for c in carries if not c.lifted and c.detected_s is not None]
    return {
        "carries": len(carries),
        "detected_p50_s": _percentile(unnoticed, 50),
        "detected_max_s": _percentile(unnoticed, 100),
        "undetected": sum(c.detected_s is None for c in carries),
        "found_p50_s": _percentile(found, 50),
        "found_p95_s": _percentile(found, 95),
        "found_within_20_s_pct": round(100.0 * sum(f <= 20.0 for f in found) / len(carries), 1),
        "confidently_wrong": sum(c.wrong_s > 0.0 for c in carries),
    }


def _percentile(values: list[float], share: float) -> float | None:
    return _rounded(float(np.percentile(values, share))) if values else None


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 1)
