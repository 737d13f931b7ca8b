"""Homes by seed: `random:SEED` is the same home wherever and whenever it is built.

20 to 60 m2, one to six rooms, sometimes stairs. A draft that would not do (a room that cannot be
reached, floor that only a perfect driver gets at) is thrown away for the next of the same seed.
"""

from __future__ import annotations

import math

import cv2
import numpy as np

from robot.config import RobotConfig
from robot.errors import SceneError
from robot.geometry.se2 import SE2
from robot.sim.building import docked_pose
from robot.sim.floor_plan import HALF_WALL_M, FloorPlan, Rect, floor_plan
from robot.sim.furnish import WALLS, Furnisher
from robot.sim.scene_file import CliffTable, DockTable, RoomTable, SceneTable
from robot.sim.world import World

AREA_M2 = (20.0, 60.0)
ROOM_M2 = (8.0, 13.0)  # floor to a room, on average
MOST_ROOMS = 6
MOST_DRAFTS = 200
DOOR_ZONE_M = 0.75
DOCK_OFF_M, DOCK_SIDE_M, DOCK_AHEAD_M = 0.08, 0.65, 1.7
STAIRS_CHANCE, STAIRS_M = 0.2, (0.9, 1.5)
STAIRS_EDGE_M = 0.6  # from them to the next piece
FLOORS = ("planks", "parquet", "tiles", "carpet")
ROLES = ("living", "bedroom", "kitchen", "study", "bath", "bedroom")
CELL_M = 0.025
EASY_M = 0.05  # floor that needs less room to spare than this is hard to reach
LEAST_JOINED, LEAST_EASY, LEAST_FREE = 0.98, 0.96, 0.45


def random_home(seed: int, robot: RobotConfig) -> SceneTable:
    """The home of this seed. Raises SceneError if none of its drafts will do."""
    from robot.sim.scene import build_scene

    for draft in range(MOST_DRAFTS):
        rng = np.random.default_rng([seed, draft, 6061])
        table = _draft(rng, robot)
        if table is None:
            continue
        try:
            world = build_scene(table, f"random:{seed}", robot)
        except SceneError:
            continue
        if livable(world, robot, sum((r.x[1] - r.x[0]) * (r.y[1] - r.y[0]) for r in table.rooms)):
            return table
    raise SceneError(f"random:{seed}: no home came out of {MOST_DRAFTS} drafts; use another seed.")


def livable(
    world: World,
    robot: RobotConfig,
    area_m2: float,
    least_joined: float = LEAST_JOINED,
    least_easy: float = LEAST_EASY,
) -> bool:
    """True if the robot gets nearly everywhere it fits, with a little room to spare.

    `least_joined` is the share of its places that it reaches from the dock, `least_easy` the share
    of the floor that it sweeps when it keeps `EASY_M` more from everything; `area_m2` is the floor.
    """
    occupied, x0, y0 = world.occupancy(CELL_M)
    clear_m = cv2.distanceTransform((~occupied).astype(np.uint8), cv2.DIST_L2, 5) * CELL_M
    clear_m -= CELL_M / 2.0
    inside = world.start @ SE2(-0.6)
    at = int((inside.y_m - y0) / CELL_M), int((inside.x_m - x0) / CELL_M)
    fits, easy = (_joined(clear_m >= robot.radius_m + more, at) for more in (0.0, EASY_M))
    if fits is None or easy is None:
        return False
    # Inside the walls only: the raster's margin is free as well, but no floor.
    _, labels = cv2.connectedComponents((~occupied).astype(np.uint8), connectivity=4)
    indoors = (labels != labels[0, 0]) & (clear_m >= robot.radius_m)
    joined = np.count_nonzero(fits) / np.count_nonzero(indoors)
    floor = _grown(fits, robot.brush_width_m / 2.0)
    swept = _grown(easy, robot.brush_width_m / 2.0 + EASY_M)
    kept = np.count_nonzero(swept & floor) / np.count_nonzero(floor)
    enough = np.count_nonzero(floor) * CELL_M**2 >= LEAST_FREE * area_m2
    return bool(joined >= least_joined and kept >= least_easy and enough)


def _joined(fits: np.ndarray, at: tuple[int, int]) -> np.ndarray | None:
    """The part of a mask around a cell; None if the cell is not in it."""
    _, labels = cv2.connectedComponents(fits.astype(np.uint8), connectivity=4)
    label = int(labels[at])
    return None if label == 0 else labels == label


def _grown(mask: np.ndarray, by_m: float) -> np.ndarray:
    far = cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, 5)
    return np.asarray(far * CELL_M <= by_m)


def _draft(rng: np.random.Generator, robot: RobotConfig) -> SceneTable | None:
    area, aspect = float(rng.uniform(*AREA_M2)), float(rng.uniform(1.0, 1.6))
    width, depth = round(math.sqrt(area * aspect), 1), round(math.sqrt(area / aspect), 1)
    count = int(np.clip(round(area / rng.uniform(*ROOM_M2)), 1, MOST_ROOMS))
    plan = floor_plan(rng, width, depth, count)
    if plan is None or not AREA_M2[0] <= plan.whole.area_m2 <= AREA_M2[1]:
        return None
    rooms = sorted(plan.rooms, key=lambda room: -room.area_m2)
    zones = [door.zone(DOOR_ZONE_M) for door in plan.doors]
    dock = _dock(rng, rooms[0], zones)
    if dock is None:
        return None
    zones.append(_before(dock, robot))
    cliff = _stairs(rng, rooms[1 if len(rooms) > 1 else 0], plan, zones)
    if cliff is not None:
        zones.append(Rect(cliff.x[0], cliff.y[0], cliff.x[1], cliff.y[1]).grown(STAIRS_EDGE_M))
    furniture = []
    for k, room in enumerate(rooms):
        furnisher = Furnisher(rng, room, zones)
        furnisher.furnish(ROLES[k])
        furniture += furnisher.pieces
    return SceneTable(
        dock=dock,
        rooms=[floor for room in rooms for floor in _floors(rng, room, cliff)],
        walls=plan.walls(rng),
        furniture=furniture,
        cliffs=[] if cliff is None else [cliff],
    )


def _dock(rng: np.random.Generator, room: Rect, zones: list[Rect]) -> DockTable | None:
    """At a wall, where nothing but floor is before it."""
    inner = room.grown(-HALF_WALL_M)
    for _ in range(20):
        yaw = list(WALLS)[rng.integers(4)]
        wx, wy = WALLS[yaw]
        span = (inner.y0, inner.y1) if wx else (inner.x0, inner.x1)
        along = round(float(rng.uniform(span[0] + 0.7, span[1] - 0.7)), 2)
        x = along if not wx else (inner.x0 + DOCK_OFF_M if wx < 0 else inner.x1 - DOCK_OFF_M)
        y = along if not wy else (inner.y0 + DOCK_OFF_M if wy < 0 else inner.y1 - DOCK_OFF_M)
        dock = DockTable(at=(round(x, 3), round(y, 3)), yaw_deg=yaw)
        if not any(Rect(x, y, x, y).grown(0.35).meets(zone) for zone in zones):
            return dock
    return None


def _before(dock: DockTable, robot: RobotConfig) -> Rect:
    """The floor on which the robot comes home."""
    pose = SE2(*dock.at, math.radians(dock.yaw_deg))
    corners = [(-0.1, -DOCK_SIDE_M), (DOCK_AHEAD_M, DOCK_SIDE_M)]
    points = [*pose.apply(np.array(corners)), docked_pose(pose, robot).apply(np.zeros(2))]
    low, high = np.min(points, axis=0), np.max(points, axis=0)
    return Rect(float(low[0]), float(low[1]), float(high[0]), float(high[1]))


def _stairs(
    rng: np.random.Generator, room: Rect, plan: FloorPlan, zones: list[Rect]
) -> CliffTable | None:
    """Down in a corner of the home that lies in `room`; None: there are none, or no corner."""
    if rng.random() > STAIRS_CHANCE:
        return None
    whole, (wide, long) = plan.whole, STAIRS_M
    for x, y in rng.permutation([(0, 0), (0, 1), (1, 0), (1, 1)]):
        x0, y0 = whole.x1 - wide if x else whole.x0, whole.y1 - long if y else whole.y0
        rect = Rect(round(x0, 3), round(y0, 3), round(x0 + wide, 3), round(y0 + long, 3))
        if rect.within(room) and not any(rect.grown(0.3).meets(zone) for zone in zones):
            return CliffTable(x=(rect.x0, rect.x1), y=(rect.y0, rect.y1), down="+y" if y else "-y")
    return None


def _floors(rng: np.random.Generator, room: Rect, cliff: CliffTable | None) -> list[RoomTable]:
    """A room's floor, in two parts where stairs take a corner of it."""
    floor = f"{FLOORS[rng.integers(len(FLOORS))]}:{rng.integers(100)}"
    whole = RoomTable(x=(room.x0, room.x1), y=(room.y0, room.y1), floor=floor)
    if cliff is None or not Rect(cliff.x[0], cliff.y[0], cliff.x[1], cliff.y[1]).within(room):
        return [whole]
    west = cliff.x[0] <= room.x0
    beside = (cliff.x[1], room.x1) if west else (room.x0, cliff.x[0])
    south = cliff.y[0] <= room.y0
    rest = (cliff.y[1], room.y1) if south else (room.y0, cliff.y[0])
    return [
        RoomTable(x=beside, y=whole.y, floor=floor),
        RoomTable(x=cliff.x, y=rest, floor=floor, lamp=False),
    ]
