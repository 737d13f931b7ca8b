"""The world as the simulator knows it: what is drawn, what is bumped into, where floor ends."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from robot.config import RobotConfig
from robot.errors import SceneError
from robot.geometry.se2 import SE2
from robot.sim.collide import clearance_m
from robot.sim.mesh import Mesh
from robot.sim.renderer import TextureAtlas


@dataclass(frozen=True, slots=True, eq=False)
class ReachableFloor:
    """Raster of what the robot can reach; cell (0, 0) begins at the origin, rows along y.

    `centres` are positions of the robot's centre that are connected to the start, `floor` is what
    the brush sweeps from them.
    """

    resolution_m: float
    origin_x_m: float
    origin_y_m: float
    centres: np.ndarray
    floor: np.ndarray

    @property
    def area_m2(self) -> float:
        """Area of `floor`."""
        return float(self.floor.sum()) * self.resolution_m**2


@dataclass(frozen=True, eq=False)
class World:
    """A scene, built. Coordinates are the scene's: metres, z up, floor at z = 0.

    `obstacles` are convex polygons (k, 2) of all that stands between the floor and the robot's
    height; `cliffs` are polygons where floor is missing. `dock` is the centre of the marker's face,
    x out of it; the robot on its dock stands at `start`. `draw` makes mesh and textures, once,
    when a picture is first asked for.
    """

    name: str
    obstacles: tuple[np.ndarray, ...]
    cliffs: tuple[np.ndarray, ...]
    dock: SE2
    start: SE2
    draw: Callable[[], tuple[Mesh, TextureAtlas]]

    @cached_property
    def _drawn(self) -> tuple[Mesh, TextureAtlas]:
        return self.draw()

    @property
    def mesh(self) -> Mesh:
        """The triangles, lit."""
        return self._drawn[0]

    @property
    def atlas(self) -> TextureAtlas:
        """The textures of `mesh`."""
        return self._drawn[1]

    def segments(self) -> np.ndarray:
        """Edges (n, 4) of all obstacles: x0, y0, x1, y1."""
        return segments_of(self.obstacles)

    def bounds(self) -> tuple[float, float, float, float]:
        """(min x, min y, max x, max y) of all obstacles and cliffs."""
        points = np.concatenate([*self.obstacles, *self.cliffs])
        low, high = points.min(axis=0), points.max(axis=0)
        return float(low[0]), float(low[1]), float(high[0]), float(high[1])

    def occupancy(self, resolution_m: float = 0.02) -> tuple[np.ndarray, float, float]:
        """Bool raster (rows = y) of obstacles and cliffs, and its origin (x_m, y_m)."""
        x0, y0, x1, y1 = self.bounds()
        x0, y0 = x0 - 0.1, y0 - 0.1
        shape = (
            math.ceil((y1 + 0.1 - y0) / resolution_m),
            math.ceil((x1 + 0.1 - x0) / resolution_m),
        )
        raster = np.zeros(shape, np.uint8)
        for polygon in (*self.obstacles, *self.cliffs):
            cells = (polygon - [x0, y0]) / resolution_m - 0.5
            cv2.fillPoly(raster, [np.rint(cells * 256).astype(np.int32)], 1, shift=8)
        return raster.astype(bool), x0, y0

    def reachable(self, robot: RobotConfig, resolution_m: float = 0.02) -> ReachableFloor:
        """Floor that the brush sweeps from every place the robot can get to from its dock.

        The raster only decides which cells lie inside things; whether the robot fits is measured
        to the outlines themselves. Raises SceneError when the robot cannot even leave the dock.
        """
        occupied, x0, y0 = self.occupancy(resolution_m)
        clearance = clearance_m(
            segments_of((*self.obstacles, *self.cliffs)),
            x0,
            y0,
            resolution_m,
            occupied.shape,
            robot.radius_m + resolution_m,
        )
        free = (clearance >= robot.radius_m) & ~occupied
        away = self.start @ SE2(-0.3, 0.0, 0.0)  # on the dock itself it touches
        _, labels = cv2.connectedComponents(free.astype(np.uint8), connectivity=4)
        row, column = int((away.y_m - y0) / resolution_m), int((away.x_m - x0) / resolution_m)
        inside = 0 <= row < labels.shape[0] and 0 <= column < labels.shape[1]
        label = labels[row, column] if inside else 0
        if label == 0:
            raise SceneError(
                f"{self.name}: the dock has no free floor behind the robot; move the dock or the "
                "furniture in front of it."
            )
        reached = labels == label
        far = cv2.distanceTransform((~reached).astype(np.uint8), cv2.DIST_L2, 5)
        floor = (far * resolution_m <= robot.brush_width_m / 2) & ~occupied
        return ReachableFloor(resolution_m, x0, y0, reached, floor)


def segments_of(polygons: Sequence[np.ndarray]) -> np.ndarray:
    """Edges (n, 4) of polygons: x0, y0, x1, y1."""
    edges = [np.hstack([p, np.roll(p, -1, axis=0)]) for p in polygons]
    return np.concatenate(edges) if edges else np.empty((0, 4))
