"""The twelve faults: how each one strikes, when, how it may end, and the words that name it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib import resources

from msgspec import structs

from robot.bench.trial import Trial, box
from robot.geometry.se2 import SE2
from robot.sim.faults import Patch
from robot.sim.scene import build_scene, parse_scene

SCENE = "flat"
WORK = frozenset({"clean", "spot", "zone", "room", "goto", "undock", "look"})
PASSED_M = 0.8  # so far from a patch on the floor it went another way
AHEAD_M = 0.26  # from the centre to what lies before the robot


@dataclass(frozen=True)
class Fault:
    """`ready` says when it may strike; `strike` breaks; `later` may mend, asked every tick.

    `met` are the states in which the robot has met it; none: at once. `ends` are states that end
    well, `words` what a reason must hold one of.
    """

    name: str
    strike: Callable[[Trial], None]
    words: tuple[str, ...]
    ready: Callable[[Trial], bool] = lambda trial: trial.state in WORK - {"undock", "look"}
    later: Callable[[Trial, float], None] = lambda trial, since_s: None
    met: frozenset[str] = frozenset()
    ends: frozenset[str] = frozenset()
    after_s: tuple[float, float] = (18.0, 32.0)


def _slip(trial: Trial) -> None:
    trial.base.faults.slip = 0.95


def _no_slip_later(trial: Trial, since_s: float) -> None:
    if trial.seed % 2 and since_s > 10.0:
        trial.base.faults.slip = 0.0


def _block(trial: Trial) -> None:
    trial.base.faults.blocked = trial.seed % 2


def _unblock_later(trial: Trial, since_s: float) -> None:
    if trial.seed % 3 == 0 and since_s > 6.0:
        trial.base.faults.blocked = None


def _carpet(trial: Trial) -> None:
    edge = box(trial.pose @ SE2(AHEAD_M + 0.1), 0.15, 0.8)
    trial.base.faults.patches[:] = [Patch(edge, slip=0.97)]


def _close_in(trial: Trial) -> None:
    """Half a square metre is left."""
    half, thick, at = math.sqrt(0.5) / 2.0, 0.04, trial.pose
    out, long = half + thick / 2.0, 2.0 * (half + thick)
    trial.put(
        box(at @ SE2(out), thick, long),
        box(at @ SE2(-out), thick, long),
        box(at @ SE2(0.0, out), long, thick),
        box(at @ SE2(0.0, -out), long, thick),
    )


def _cable(trial: Trial) -> None:
    cable = box(trial.pose @ SE2(AHEAD_M), 0.12, 0.5)
    trial.base.faults.patches[:] = [Patch(cable, blocks=trial.seed % 2)]


def _laid_anew(lay: Callable[[Trial], None]) -> Callable[[Trial, float], None]:
    """Once more before the robot, as it went another way."""

    def later(trial: Trial, since_s: float) -> None:
        faults, drive = trial.base.faults, trial.drives[-1]
        x, y = faults.patches[0].polygon.mean(axis=0)
        passed = trial.pose.distance_m(SE2(x, y)) > PASSED_M
        if passed and not faults.entered and drive.v_mps > 0.1 > abs(drive.yaw_rate_radps):
            lay(trial)

    return later


def _hold_bumper(trial: Trial) -> None:
    trial.base.faults.bump_held = True


def _free_bumper_later(trial: Trial, since_s: float) -> None:
    if trial.seed % 2 and since_s > 8.0:
        trial.base.faults.bump_held = False


def _lift(trial: Trial) -> None:
    trial.base.lift()


def _put_down_later(trial: Trial, since_s: float) -> None:
    if since_s > 3.0 and trial.base.wheel_drop:
        trial.base.carry_to(trial.elsewhere())


def _away_from_dock(trial: Trial) -> bool:
    return (
        trial.state in WORK - {"undock", "look"} and trial.pose.distance_m(trial.world.start) > 1.5
    )


def _close_door(trial: Trial) -> None:
    """A wall between the robot and its dock, from wall to wall."""
    here, home = trial.pose, trial.world.start
    yaw = math.atan2(home.y_m - here.y_m, home.x_m - here.x_m)
    between = SE2((here.x_m + home.x_m) / 2.0, (here.y_m + home.y_m) / 2.0, yaw)
    trial.put(box(between, 0.05, 12.0))
    trial.ask("dock")


def _move_dock(trial: Trial) -> None:
    """Along its wall; its plate goes with it."""
    text = resources.files("robot.sim").joinpath(f"scenes/{SCENE}.toml").read_text()
    table = parse_scene(text, SCENE)
    x, y = table.dock.at
    moved = structs.replace(table.dock, at=(x, y + float(trial.rng.uniform(0.5, 0.9))))
    world = build_scene(structs.replace(table, dock=moved), SCENE, trial.config.robot)
    trial.rebuild(world)
    trial.ask("dock")


def _occupy_dock(trial: Trial) -> None:
    """Something stands on its plate, or lies before its contacts."""
    at = trial.world.start
    if trial.seed % 2:
        trial.put(box(at @ SE2(0.05), 0.25, 0.25))
    else:
        trial.put(box(at @ SE2(0.10), 0.10, 0.06))
    trial.ask("dock")


def _drain(pct: float) -> Callable[[Trial], None]:
    def drain(trial: Trial) -> None:
        link = trial.config.link
        span_v = link.battery_full_v - link.battery_empty_v
        trial.base.battery_v = link.battery_empty_v + pct / 100.0 * span_v

    return drain


_HOMING = Fault("", _slip, (), met=frozenset({"dock"}))
FAULTS: tuple[Fault, ...] = (
    Fault("wheel slip", _slip, ("wheels turn",), later=_no_slip_later),
    Fault("wheel blocked", _block, ("a wheel",), later=_unblock_later),
    Fault("carpet edge", _carpet, ("wheels turn", "slippery"), later=_laid_anew(_carpet)),
    Fault("closed in", _close_in, ("closed in", "no way", "out of reach")),
    Fault("cable", _cable, ("a wheel",), later=_laid_anew(_cable)),
    Fault("bumper held", _hold_bumper, ("bumper",), later=_free_bumper_later),
    Fault("lifted", _lift, ("put down",), later=_put_down_later),
    Fault(
        "door closed",
        _close_door,
        ("no way", "was not seen"),
        ready=_away_from_dock,
        after_s=(24.0, 40.0),
    ),
    replace(
        _HOMING, name="dock moved", strike=_move_dock, words=("dock",), ends=frozenset({"done"})
    ),
    replace(_HOMING, name="dock occupied", strike=_occupy_dock, words=("docking failed",)),
    Fault("battery 20 %", _drain(19.5), ("battery",), ends=frozenset({"charge"})),
    Fault("battery 5 %", _drain(4.9), ("battery",)),
)
