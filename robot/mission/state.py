"""What every state gets to see, and what it answers."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

from robot.config import ControlConfig, MissionConfig, RobotConfig
from robot.control.safety import SafetyGate
from robot.control.wish import Wish
from robot.geometry.se2 import SE2
from robot.mapping.grid import OccupancyGrid
from robot.mapping.notes import MapNotes
from robot.mapping.swept import SweptFloor
from robot.messages import ClearOrder, Command, Contact, Grid, LinkState
from robot.mission.desk import PlanDesk
from robot.mission.dock_sight import DockSight
from robot.mission.job import Job
from robot.mission.settings import Settings
from robot.mission.touch import LATELY, Touch
from robot.mission.trail import Trail

CLEAR_EVERY_S = 0.3
Name = Literal["undock", "look", "work", "return", "dock", "done", "charge"]


@dataclass(slots=True)
class Trouble:
    """Tries to get free, until the robot drives on freely: one trouble (`ladder`)."""

    since_ns: int = 0  # when the first began; later by what was worked between meetings,
    place: SE2 = field(default_factory=SE2)  # odom_from_base then,
    swept_m2: float = 0.0  # and what had been swept
    tries: int = 0
    over_ns: int = 0  # when the last one ended,
    over_at_m: float = 0.0  # and the distance driven then
    back_m: float = 0.0  # backed off in all of them
    kinds: set[str] = field(default_factory=set)  # of all of them
    stop: str = ""  # the motor controller's last stop that was no touch


@dataclass(slots=True)
class RunRecord:
    """What one cleaning run must remember across its states."""

    job: Job = field(default_factory=Job)
    errand: State | None = None  # to be done instead of the job
    from_dock: bool = True  # it began there, and will end there
    charges: bool = False  # the battery sends it home: afterwards it goes on
    dock_moves: int = 0  # times the dock was found elsewhere
    started_ns: int = 0
    plans: int = 0
    looks: int = 0
    due_m2: float = 0.0  # will have been swept when the last plan is driven
    fruitless_plans: int = 0
    dock_tries: int = 0
    trouble: Trouble = field(default_factory=Trouble)
    held_at: list[SE2] = field(default_factory=list)  # odom_from_base where wheels were held
    touched_at: list[SE2] = field(default_factory=list)  # and where a touch was a trouble
    blocked_at: list[SE2] = field(default_factory=list)  # or stood right before it
    touches: deque[Touch] = field(default_factory=lambda: deque(maxlen=LATELY))  # latest first
    trail: Trail = field(default_factory=Trail)


@dataclass(slots=True)
class Situation:
    """One tick as the states see it. From `grid` on it is the same objects every tick."""

    t_ns: int
    pose: SE2  # world_from_base, now
    yaw_sigma_rad: float
    health: Literal["ok", "degraded", "lost"]
    odom: SE2  # odom_from_base, now: never jumps
    driven_m: float  # sum of absolute driving
    turned_rad: float  # sum of absolute turning
    contact: Contact
    link: LinkState
    battery_pct: float  # NaN: unknown
    view: Grid  # the grid some moments ago
    known_free_m2: float  # in it
    grid: OccupancyGrid
    swept: SweptFloor
    gate: SafetyGate
    desk: PlanDesk
    sight: DockSight
    robot: RobotConfig
    control: ControlConfig
    config: MissionConfig
    notes: MapNotes = field(default_factory=MapNotes)
    settings: Settings = field(default_factory=Settings)
    blind_s: float = 0.0  # how long nothing useful has been seen
    slipping: bool = False  # the wheels turn, but the floor does not pass
    recognised: float = 1.0  # share of what was seen lately that the map knows; NaN: too little
    recognised_round: float = 1.0  # the same of all since the place became doubtful
    settle: Callable[[], None] = lambda: None  # the pose is right although nobody was sure of it
    run: RunRecord = field(default_factory=RunRecord)
    orders: list[Command] = field(default_factory=list)  # besides driving

    @property
    def latched(self) -> bool:
        """Whether the motor controller holds a stop."""
        return bool(self.link.stop_reason)

    @property
    def touching(self) -> bool:
        """Whether the bumper is pressed."""
        return self.contact.bump_left or self.contact.bump_right


@dataclass(frozen=True, slots=True)
class Step:
    """Answer of a state to one tick: a wish, or the next state with the reason for the change."""

    wish: Wish = field(default_factory=Wish)
    then: State | Name | None = None
    reason: str = ""


class State:
    """One thing that the robot can be doing. `name` is what people read."""

    name = "state"
    active = True  # drives by itself: battery, time and progress are watched
    guarded = True  # a contact or a latched stop leads to recovery
    leaves_trail = False  # its way may be gone back

    @property
    def after_trouble(self) -> State:
        """What goes on after a recovery from trouble in this state."""
        return self

    def bears(self, now: Situation) -> bool:
        """Whether a touch is part of what it is doing, and it gets free by itself."""
        return False

    def enter(self, now: Situation) -> None:
        """Called once, before the first tick in this state."""

    def tick(self, now: Situation) -> Step:
        """What to do now."""
        raise NotImplementedError


class Latch:
    """Clears the motor controller's stop, on purpose and not too often."""

    def __init__(self) -> None:
        self._asked_ns: int | None = None

    def clear(self, now: Situation, reason: str) -> bool:
        """Whether no stop is held; otherwise ask for it to be cleared."""
        if not now.latched:
            return True
        if self._asked_ns is None or seconds(self._asked_ns, now.t_ns) >= CLEAR_EVERY_S:
            self._asked_ns = now.t_ns
            now.orders.append(ClearOrder(now.t_ns, reason))
        return False


def seconds(since_ns: int, now_ns: int) -> float:
    """Seconds between two stamps."""
    return (now_ns - since_ns) * 1e-9
