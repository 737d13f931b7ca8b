"""A robot in the middle of something, for tests of the mission's states."""

from robot.config import Config
from robot.control.safety import SafetyGate
from robot.geometry.se2 import SE2
from robot.mapping.grid import OccupancyGrid
from robot.mapping.swept import SweptFloor
from robot.messages import Contact, LinkState
from robot.mission.desk import PlanDesk
from robot.mission.dock_sight import DockSight
from robot.mission.state import Situation


def situation(config: Config, contact: Contact, stop: str = "") -> Situation:
    """Half a metre of free floor around it; the motor controller holds `stop` if there is one."""
    grid = OccupancyGrid(config.mapping)
    grid.clear_footprint(SE2(), 0.5)
    swept = SweptFloor(config.mapping, config.robot.brush_width_m)
    return Situation(
        t_ns=0, pose=SE2(), yaw_sigma_rad=0.01, health="ok", odom=SE2(), driven_m=5.0,
        turned_rad=0.0, contact=contact, link=LinkState(0, True, stop), battery_pct=80.0,
        view=grid.snapshot(), known_free_m2=1.0, grid=grid, swept=swept,
        gate=SafetyGate(config.control, config.robot), desk=PlanDesk(grid, swept),
        sight=DockSight(config.robot), robot=config.robot, control=config.control,
        config=config.mission,
    )  # fmt: skip
