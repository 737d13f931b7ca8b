"""The whole robot on one page: events in, commands and reports out. Pure and deterministic.

What each event means:

    WheelTravel, ImuSample -> odometry and SLAM       Contact, LinkState -> the safety gate
    Seen -> SLAM, grid, gate, the dock's marker       Planned, Request   -> the mission
    Tick -> the mission wishes, the gate orders

The map lives in `world`, which SLAM may correct at any frame; short memories (what was just seen,
where the dock's marker stood) live in `odom`, which never jumps.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from robot.config import Config
from robot.control.odometry import DeadReckoning
from robot.control.safety import SafetyGate
from robot.geometry.se2 import SE2
from robot.home import Home
from robot.mapping.grid import OccupancyGrid
from robot.mapping.notes import MapNotes
from robot.mapping.swept import SweptFloor
from robot.messages import (
    Battery,
    Command,
    Contact,
    DriveCommand,
    Event,
    Grid,
    ImuSample,
    LinkState,
    MapReport,
    Planned,
    Request,
    Seen,
    Tick,
    WheelTravel,
)
from robot.mission.desk import PlanDesk, free_area_m2
from robot.mission.dock_sight import DockSight
from robot.mission.drive import matter_near
from robot.mission.mission import Mission
from robot.mission.recognise import Recognition
from robot.mission.room_book import RoomBook
from robot.mission.settings import Settings
from robot.mission.slip import SlipWatch
from robot.mission.state import Situation
from robot.mission.states.wheel_only import tells_something
from robot.slam.slam import Slam

MAP_REPORT_NS = 2_000_000_000
VIEW_EVERY_NS = 400_000_000
DOCKED_COV = np.diag([0.02, 0.02, 0.05]) ** 2  # m, m, rad: how exactly it stands on its dock
NOTHING = Grid(0.05, 0.0, 0.0, np.full((1, 1), -1, np.int8))
SETTLED_COV = np.diag([0.06, 0.06, 0.06]) ** 2  # where the map knows what is seen


class Brain:
    """The robot's mind. `on` is all there is."""

    def __init__(self, config: Config, home: Home | None = None) -> None:
        """With `home` the robot knows its map; it finds itself there, at once on the dock."""
        self._config = config
        self._slam = Slam(config.slam, config.robot, None if home is None else home.slam)
        self._odometry = DeadReckoning(config.robot)
        self._grid = OccupancyGrid(config.mapping)
        self._swept = SweptFloor(config.mapping, config.robot.brush_width_m)
        self._gate = SafetyGate(config.control, config.robot)
        self.notes = MapNotes() if home is None else MapNotes.from_dict(home.notes)
        self._settings = Settings() if home is None else Settings.from_dict(home.settings)
        margin_m = config.mission.no_go_margin_m
        self._desk = PlanDesk(self._grid, self._swept, self.notes, margin_m)
        self._book = RoomBook(self._grid, self.notes)
        self._sight = DockSight(config.robot)
        self._mission = Mission(self._book)
        self._slip, self._recognition = SlipWatch(config.robot.track_width_m), Recognition()
        self._sighted_ns: int | None = None
        self._contact = Contact(0)
        self._link = LinkState(0, False)
        self._battery_pct = math.nan
        self._view, self._view_ns = NOTHING, -VIEW_EVERY_NS
        self._known_free_m2 = 0.0
        self._mapped_ns = -MAP_REPORT_NS
        self._world_from_odom = SE2()
        self._estimate = self._slam.pose_at(0)
        self._wakes_up = home is not None
        if home is not None:
            self._grid.restore(home.grid)
            self._sight.world_from_docked = home.world_from_docked
            self._sight.docked_from_marker = home.docked_from_marker

    def on(self, event: Event) -> list[Command]:
        """What to do and to report after this event."""
        match event:
            case Tick():
                return self._tick(event.t_ns)
            case WheelTravel():
                self._odometry.wheels(event)
                self._slip.wheels(event)
                self._slam.odometry(event)
            case ImuSample():
                self._odometry.imu(event)
                self._slam.odometry(event)
            case Contact():
                self._set_contact(event)
                self._gate.contact(event)
                self._locate(event)
            case LinkState():
                self._link = event
                self._gate.link(event)
            case Battery():
                self._battery_pct = event.charge_pct
            case Seen():
                return self._seen(event)
            case Planned():
                if not self._book.planned(event):
                    self._desk.planned(event)
            case Request():
                self._mission.request(event)
        return []

    def _set_contact(self, contact: Contact) -> None:
        if contact.wheel_drop:  # what was seen around lies elsewhere now
            self._recognition.forget()
            self._gate.sight.forget()
        self._contact = contact

    def view(self) -> tuple[Grid, np.ndarray]:
        """For people: the grid some moments ago, and which of its cells are swept. Only reads."""
        if self._view is NOTHING:
            return NOTHING, np.zeros(NOTHING.cells.shape, bool)
        return self._view, self._swept.on(self._view)

    def home(self) -> Home:
        """All that another run can begin with; only reads."""
        docked, marker = self._sight.world_from_docked, self._sight.docked_from_marker
        drawn, settings = self.notes.to_dict(), self._settings.to_dict()
        return Home(self._slam.memory(), self._grid.memory(), docked, marker, drawn, settings)

    def _locate(self, contact: Contact) -> None:
        """On the dock the pose is known; in somebody's hands it is not."""
        docked = self._sight.world_from_docked
        if self._wakes_up and contact.charging and docked is not None:
            self._slam.put(docked, DOCKED_COV)
        self._wakes_up = False
        if contact.wheel_drop:
            self._slam.lift()

    # ------------------------------------------------------------------ what a frame changes

    def _seen(self, seen: Seen) -> list[Command]:
        odom_from_base = self._odometry.at(seen.t_ns)
        self._recognition.look(seen.t_ns, odom_from_base, seen.scan)
        estimate = self._slam.see(seen, partial(self._share_at, odom_from_base))
        if (estimate.health == "lost") != (self._estimate.health == "lost"):
            self._recognition.forget()  # what was seen stands elsewhere, or for another place
        self._gate.see(seen, odom_from_base)
        if seen.marker is not None:
            world_from_base = estimate.world_from_base
            self._sight.see(seen.t_ns, seen.marker, odom_from_base, world_from_base)
        self._slip.see(seen.t_ns, seen.motion)
        self._recognition.see(self._view, estimate.world_from_base, seen.scan)
        if tells_something(seen, self._config.mission.blind_quality):
            self._sighted_ns = seen.t_ns
        trusted = self._mission.trusts_place
        if estimate.health != "lost" and trusted:
            self._grid.integrate(estimate.world_from_base, seen.scan)
        self._estimate = estimate
        self._world_from_odom = estimate.world_from_base @ odom_from_base.inverse()
        if trusted:
            self._feel_floor()
        self._gate.keep_out.know(self._barriers(), odom_from_base)
        if seen.t_ns - self._view_ns >= VIEW_EVERY_NS:
            self._view, self._view_ns = self._grid.snapshot(), seen.t_ns
            self._known_free_m2 = free_area_m2(self._view.cells, self._view.resolution_m)
            near = matter_near(self._view, self._pose(), self._config.control.memory_range_m / 2.0)
            self._gate.sight.know(self._world_from_odom.inverse().apply(near))
        return [estimate, *self._map_report(seen.t_ns)]

    def _share_at(self, odom_from_base: SE2, world_from_base: SE2) -> float:
        """Of what was seen lately, the share that the map has, were the robot there."""
        return self._recognition.share_at(self._view, world_from_base @ odom_from_base.inverse())

    def _feel_floor(self) -> None:
        """There is floor under the robot; the wheels tell how hard it is to cross."""
        pose, robot = self._pose(), self._config.robot
        self._grid.clear_footprint(pose, robot.radius_m)
        pressed = self._contact.bump_left or self._contact.bump_right
        if not pressed and math.isfinite(lost := self._slip.lost):
            self._grid.feel(pose, robot.track_width_m / 2.0, lost)

    def _pose(self) -> SE2:
        """world_from_base now: the last estimate composed with the odometry since its frame."""
        return self._world_from_odom @ self._odometry.odom_from_base

    def _settle(self) -> None:
        """The map has confirmed the pose: it is believed at the next tick, not the next frame."""
        self._slam.confirm(SETTLED_COV)
        self._estimate = self._slam.pose_at(self._estimate.t_ns)

    def _barriers(self) -> np.ndarray:
        """What must not be crossed, as lines (n, 4) of odom."""
        lines = np.array(self.notes.current.barriers()).reshape(-1, 2)
        return self._world_from_odom.inverse().apply(lines).reshape(-1, 4)

    def _map_report(self, t_ns: int) -> list[Command]:
        if t_ns - self._mapped_ns < MAP_REPORT_NS:
            return []
        self._mapped_ns = t_ns
        grid = self._grid.snapshot()
        return [MapReport(t_ns, grid, self._swept.on(grid), *self._slam.landmarks())]

    # ------------------------------------------------------------------ the beat

    def _tick(self, t_ns: int) -> list[Command]:
        now = self._situation(t_ns)
        wish = self._mission.tick(now)
        if not self._mission.state.guarded:
            self._slip.forget()
        order = self._gate.check(
            t_ns, wish, now.odom, self._odometry.t_ns, localised=now.health != "lost"
        )
        self._sweep(order, now.pose)
        return [order, *now.orders]

    def _sweep(self, order: DriveCommand, pose: SE2) -> None:
        if order.brush > 0.0:
            self._swept.sweep(pose)
        else:
            self._swept.lift()

    def _situation(self, t_ns: int) -> Situation:
        if self._sighted_ns is None:
            self._sighted_ns = t_ns
        return Situation(
            t_ns=t_ns,
            pose=self._pose(),
            yaw_sigma_rad=math.sqrt(max(0.0, float(self._estimate.cov[2, 2]))),
            health=self._estimate.health,
            odom=self._odometry.odom_from_base,
            driven_m=self._odometry.driven_m,
            turned_rad=self._odometry.turned_rad,
            contact=self._contact,
            link=self._link,
            battery_pct=self._battery_pct,
            view=self._view,
            known_free_m2=self._known_free_m2,
            grid=self._grid,
            swept=self._swept,
            gate=self._gate,
            desk=self._desk,
            sight=self._sight,
            robot=self._config.robot,
            control=self._config.control,
            config=self._config.mission,
            notes=self.notes,
            settings=self._settings,
            blind_s=(t_ns - self._sighted_ns) * 1e-9,
            slipping=self._slip.slipping,
            recognised=self._recognition.share,
            recognised_round=self._recognition.whole_share,
            settle=self._settle,
        )
