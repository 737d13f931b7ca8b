"""One life of the simulated robot in which something goes wrong at a known moment.

The real firmware, bridge, brain and planner; sights are drawn, or rendered.
A script is asked at every tick: it may break the robot or its world, and ask it for something.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np

from firmware_bridge.host import HostFirmware, build_host_firmware
from robot.body.eyes import DrawnEyes, Eyes, RenderedEyes
from robot.body.simulated import SimulatedBody
from robot.body.sources import open_perception
from robot.brain import Brain
from robot.config import Config
from robot.geometry.se2 import SE2
from robot.home import Home
from robot.messages import (
    Answer,
    Command,
    DriveCommand,
    Event,
    MissionState,
    PoseEstimate,
    Request,
    StereoFrame,
    Tick,
)
from robot.run import run
from robot.sim.base import SimBase
from robot.sim.drawn import DrawnSight
from robot.sim.scene import load_scene
from robot.sim.world import World

NS = 1_000_000_000
ELSEWHERE_M = 1.0  # at least so far away
Script = Callable[["Trial", float], None]


@dataclass
class Trial:
    """The robot, its world, and what has been heard of it. Poses are the scene's."""

    config: Config
    scene: str
    seed: int
    rng: np.random.Generator = field(init=False)
    states: list[MissionState] = field(default_factory=list)
    answers: list[Answer] = field(default_factory=list)
    drives: list[DriveCommand] = field(default_factory=list)
    asked: list[Request] = field(default_factory=list)  # not handed over yet
    poses: list[SE2] = field(default_factory=list)  # true ones, 10 Hz
    estimates: list[PoseEstimate] = field(default_factory=list)
    true_at: dict[int, SE2] = field(default_factory=dict)  # by the frames' t_ns
    end_s: float = 240.0
    home: Home | None = None  # the map that it knows
    rendered: bool = False  # look at pictures instead of drawing what would be seen

    def __post_init__(self) -> None:
        self.rng = np.random.default_rng([self.seed, 4711])
        self.world: World = load_scene(self.scene, self.config.robot)
        link = self.config.link
        self.base = SimBase(
            self.world,
            self.config.robot,
            self.config.sim,
            self.seed,
            metres_per_tick=link.metres_per_tick,
            full_speed_mps=link.full_speed_mps,
        )
        self.sight = DrawnSight(self.world, self.config, self.seed)
        self.brain = Brain(self.config, self.home)

    @property
    def state(self) -> str:
        """What the robot is about now."""
        return self.states[-1].state if self.states else "none"

    @property
    def pose(self) -> SE2:
        """Where it truly is."""
        return self.base.world_from_base

    def elsewhere(self) -> SE2:
        """A free place at least a metre away, any heading."""
        floor = self.world.reachable(self.config.robot)
        rows, columns = np.nonzero(floor.centres)
        x = floor.origin_x_m + (columns + 0.5) * floor.resolution_m
        y = floor.origin_y_m + (rows + 0.5) * floor.resolution_m
        far = np.flatnonzero(np.hypot(x - self.pose.x_m, y - self.pose.y_m) > ELSEWHERE_M)
        k = int(self.rng.choice(far))
        return SE2(float(x[k]), float(y[k]), float(self.rng.uniform(-math.pi, math.pi)))

    def ask(self, verb: str, *args: str) -> None:
        """Hand a request over at the next tick."""
        self.asked.append(Request(0, verb, args, 1000 + len(self.answers) + len(self.asked)))

    def rebuild(self, world: World) -> None:
        """Let the world be another one from now on."""
        self.world = world
        self.base.rebuild(world)
        self.sight.rebuild(world)

    def put(self, *polygons: np.ndarray) -> None:
        """Let obstacles (k, 2) appear."""
        self.rebuild(_with(self.world, polygons))

    def live(self, script: Script, *, start: bool = True) -> None:
        """From the dock until the mission or `end_s` ends."""
        firmware = HostFirmware(_firmware())
        eyes = self._eyes()
        body = SimulatedBody(
            self.config, self.world, self.base, firmware, eyes, self, duration_s=3600.0, start=start
        )
        try:
            run(_Scripted(self, body, script), self.brain, _NoLog())
        finally:
            body.close()
            firmware.close()
            eyes.close()

    def _eyes(self) -> Eyes:
        if not self.rendered:
            return DrawnEyes(self.sight)
        from robot.sim.render_process import RenderProcess

        camera = self.config.camera.stereo_camera()
        renderer = RenderProcess(self.scene, camera, self.config.sim, self.seed)
        return RenderedEyes(renderer, open_perception(self.config))

    # ------------------------------------------------------------------ Recorder

    def frame(self, frame: StereoFrame) -> None:
        """Pictures are not drawn here."""

    def truth(self, t_ns: int, world_from_base: SE2) -> None:
        """Remember the way, in the frame of the estimate."""
        self.poses.append(world_from_base)
        self.true_at[t_ns] = world_from_base


class _Scripted:
    """The body, with the script's requests among its events."""

    def __init__(self, trial: Trial, body: SimulatedBody, script: Script) -> None:
        self._trial, self._body, self._script = trial, body, script

    def events(self) -> Iterator[Event]:
        for event in self._body.events():
            if isinstance(event, Tick):
                trial = self._trial
                self._script(trial, event.t_ns / NS)
                for request in trial.asked:
                    yield Request(event.t_ns, request.verb, request.args, request.request_id)
                trial.asked.clear()
                if event.t_ns / NS >= trial.end_s:
                    return
            yield event

    def send(self, command: Command) -> None:
        trial = self._trial
        if isinstance(command, MissionState):
            trial.states.append(command)
        elif isinstance(command, Answer):
            trial.answers.append(command)
        elif isinstance(command, PoseEstimate):
            trial.estimates.append(command)
        elif isinstance(command, DriveCommand):
            trial.drives.append(command)
        self._body.send(command)


class _NoLog:
    """Keeps nothing."""

    def event(self, event: Event) -> None: ...

    def command(self, command: Command) -> None: ...

    def flush(self) -> None: ...


def _with(world: World, polygons: tuple[np.ndarray, ...]) -> World:
    obstacles = (*world.obstacles, *(np.asarray(p, float) for p in polygons))
    return World(world.name, obstacles, world.cliffs, world.dock, world.start, world.draw)


@cache
def _firmware() -> Path:
    """Built once a process; the folder goes with it."""
    folder = tempfile.TemporaryDirectory(prefix="sweeper-")
    _KEPT.append(folder)
    return build_host_firmware(Path(folder.name))


_KEPT: list[tempfile.TemporaryDirectory[str]] = []


def box(middle: SE2, length_m: float, width_m: float) -> np.ndarray:
    """Corners (4, 2) of a rectangle around a pose, its length along x."""
    x, y = length_m / 2.0, width_m / 2.0
    corners: np.ndarray = middle.apply(np.array([[-x, -y], [x, -y], [x, y], [-x, y]]))
    return corners
