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

import numpy as np

from robot.config import Config
from robot.control.odometry import DeadReckoning
from robot.control.safety import SafetyGate
from robot.geometry.se2 import SE2
from robot.mapping.grid import OccupancyGrid
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
from robot.mission.state import Situation
from robot.slam.slam import Slam

MAP_REPORT_NS = 2_000_000_000
VIEW_EVERY_NS = 400_000_000
NOTHING = Grid(0.05, 0.0, 0.0, np.full((1, 1), -1, np.int8))


class Brain:
    """The robot's mind. `on` is all there is."""

    def __init__(self, config: Config) -> None:
        self._config = config
        self._slam = Slam(config.slam, config.robot)
        self._odometry = DeadReckoning(config.robot)
        self._grid = OccupancyGrid(config.mapping)
        self._swept = SweptFloor(config.mapping, config.robot.brush_width_m)
        self._gate = SafetyGate(config.control, config.robot)
        self._desk = PlanDesk(self._grid, self._swept)
        self._sight = DockSight(config.robot)
        self._mission = Mission()
        self._contact = Contact(0)
        self._link = LinkState(0, False)
        self._battery_pct = math.nan
        self._view, self._view_ns = NOTHING, -VIEW_EVERY_NS
        self._known_free_m2 = 0.0
        self._mapped_ns = -MAP_REPORT_NS
        self._world_from_odom = SE2()
        self._estimate = self._slam.pose_at(0)

    def on(self, event: Event) -> list[Command]:
        """What to do and to report after this event."""
        match event:
            case Tick():
                return self._tick(event.t_ns)
            case WheelTravel():
                self._odometry.wheels(event)
                self._slam.odometry(event)
            case ImuSample():
                self._odometry.imu(event)
                self._slam.odometry(event)
            case Contact():
                self._contact = event
                self._gate.contact(event)
            case LinkState():
                self._link = event
                self._gate.link(event)
            case Battery():
                self._battery_pct = event.charge_pct
            case Seen():
                return self._seen(event)
            case Planned():
                self._desk.planned(event)
            case Request():
                self._mission.request(event)
        return []

    def view(self) -> tuple[Grid, np.ndarray]:
        """For people: the grid some moments ago, and which of its cells are swept. Only reads."""
        if self._view is NOTHING:
            return NOTHING, np.zeros(NOTHING.cells.shape, bool)
        return self._view, self._swept.on(self._view)

    # ------------------------------------------------------------------ what a frame changes

    def _seen(self, seen: Seen) -> list[Command]:
        estimate = self._slam.see(seen)
        odom_from_base = self._odometry.at(seen.t_ns)
        self._gate.see(seen, odom_from_base)
        if seen.marker is not None:
            world_from_base = estimate.world_from_base
            self._sight.see(seen.t_ns, seen.marker, odom_from_base, world_from_base)
        if estimate.health != "lost":
            self._grid.integrate(estimate.world_from_base, seen.scan)
        self._estimate = estimate
        self._world_from_odom = estimate.world_from_base @ odom_from_base.inverse()
        self._grid.clear_footprint(self._pose(), self._config.robot.radius_m)
        if seen.t_ns - self._view_ns >= VIEW_EVERY_NS:
            self._view, self._view_ns = self._grid.snapshot(), seen.t_ns
            self._known_free_m2 = free_area_m2(self._view.cells, self._view.resolution_m)
            near = matter_near(self._view, self._pose(), self._config.control.memory_range_m / 2.0)
            self._gate.sight.know(self._world_from_odom.inverse().apply(near))
        return [estimate, *self._map_report(seen.t_ns)]

    def _pose(self) -> SE2:
        """world_from_base now: the last estimate composed with the odometry since its frame."""
        return self._world_from_odom @ self._odometry.odom_from_base

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
        )
