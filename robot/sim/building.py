"""Builds rooms out of boxes: every solid gives faces to draw and, where it stands, an outline.

Drawing (textures, light) is left until somebody asks for pictures: the process that only drives
never pays for it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from robot.config import RobotConfig
from robot.geometry.se2 import SE2
from robot.sim.lighting import Lamp, Solid, bake
from robot.sim.mesh import Mesh, MeshBuilder
from robot.sim.renderer import TextureAtlas
from robot.sim.textures import Texture, check_texture, make_texture, marker

LOWEST_BUMP_M, HIGHEST_BUMP_M = 0.02, 0.10  # between these heights a thing is in the robot's way
LIGHT_STEP_M = 0.08
DOCK_PLATE_M = 0.09  # the plate reaches this far out from the marker's face
DOCK_HEIGHT_M, PLATE_HEIGHT_M, PANEL_THICK_M = 0.17, 0.03, 0.03
MARKER_CENTRE_M = 0.09  # above the floor: the height of the eyes
MARKER_MARGIN = 0.12  # white border, as a share of the printed side
AMBIENT, LAMP_POWER = 0.75, 1.5


@dataclass(slots=True)
class Building:
    """Collects solids; `draw` gives mesh and textures. Unknown textures raise SceneError."""

    obstacles: list[np.ndarray] = field(default_factory=list)
    solids: list[Solid] = field(default_factory=list)
    lamps: list[Lamp] = field(default_factory=list)
    _faces: list[tuple[np.ndarray, str, float]] = field(default_factory=list)
    _made: dict[str, Texture] = field(default_factory=dict)

    def face(self, corners_m: np.ndarray, name: str, *, glow: float = 0.0) -> None:
        """A rectangle (4, 3), counter-clockwise from outside, its first edge along the bottom."""
        if name not in self._made:
            check_texture(name)
        self._faces.append((corners_m, name, glow))

    def floor(self, x0: float, y0: float, x1: float, y1: float, name: str, z: float = 0.0) -> None:
        """A level rectangle, seen from above."""
        self.face(np.array([[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]]), name)

    def ceiling(self, x0: float, y0: float, x1: float, y1: float, z: float, name: str) -> None:
        """A level rectangle, seen from below."""
        self.face(np.array([[x0, y1, z], [x1, y1, z], [x1, y0, z], [x0, y0, z]]), name)

    def box(
        self,
        pose: SE2,
        size_m: tuple[float, float, float],
        name: str,
        *,
        bottom_m: float = 0.0,
        front: str = "",
    ) -> None:
        """A box standing at `pose` (centre; front to its x), of (depth, width, height)."""
        depth, width, height = size_m
        d, w = depth / 2, width / 2
        outline = pose.apply(np.array([[d, -w], [d, w], [-d, w], [-d, -w]]))
        low, high = bottom_m, bottom_m + height
        for k in range(4):
            a, b = outline[k], outline[(k + 1) % 4]
            corners = np.array([[*a, low], [*b, low], [*b, high], [*a, high]])
            self.face(corners, front if front and k == 0 else name)
        self.face(np.column_stack([outline, np.full(4, high)]), name)
        if low > 0:
            self.face(np.column_stack([outline[::-1], np.full(4, low)]), name)
        self.solids.append(Solid(outline, low, high))
        if low < HIGHEST_BUMP_M and high > LOWEST_BUMP_M:
            self.obstacles.append(outline)

    def legs(
        self, pose: SE2, size_m: tuple[float, float, float], thick_m: float, name: str
    ) -> None:
        """Four legs under the corners of a (depth, width, height) table."""
        depth, width, height = size_m
        x, y = (depth - thick_m) / 2, (width - thick_m) / 2
        for sx, sy in ((x, y), (x, -y), (-x, -y), (-x, y)):
            self.box(pose @ SE2(sx, sy, 0.0), (thick_m, thick_m, height), name)

    def lamp(self, x_m: float, y_m: float, z_m: float) -> None:
        """A lamp hanging at a point."""
        self.lamps.append(Lamp(x_m, y_m, z_m, LAMP_POWER))

    def dock(self, dock: SE2, robot: RobotConfig) -> None:
        """A panel with the marker, and a low plate with the charge contacts in front of it."""
        back = dock @ SE2(-PANEL_THICK_M / 2, 0.0, 0.0)
        self.box(back, (PANEL_THICK_M, robot.dock_width_m, DOCK_HEIGHT_M), "dark_wood:7")
        plate = dock @ SE2(DOCK_PLATE_M / 2, 0.0, 0.0)
        self.box(plate, (DOCK_PLATE_M, robot.dock_width_m, PLATE_HEIGHT_M), "metal:2")
        self._made["marker"] = marker(robot.dock_marker_id, MARKER_MARGIN)
        side = robot.dock_marker_size_m * (1.0 + 2.0 * MARKER_MARGIN)
        ends = (dock @ SE2(0.001, 0.0, 0.0)).apply(np.array([[0.0, -side / 2], [0.0, side / 2]]))
        low, high = MARKER_CENTRE_M - side / 2, MARKER_CENTRE_M + side / 2
        corners = np.array([[*ends[0], low], [*ends[1], low], [*ends[1], high], [*ends[0], high]])
        self.face(corners, "marker", glow=1.0)

    def draw(self) -> tuple[Mesh, TextureAtlas]:
        """The mesh with its light, and its textures."""
        mesh, images = self.mesh(0)
        return mesh, TextureAtlas.pack(images)

    def mesh(self, first_texture: int) -> tuple[Mesh, list[np.ndarray]]:
        """The mesh with its light, its textures numbered from `first_texture`, and their images."""
        builder = MeshBuilder(light_step_m=LIGHT_STEP_M)
        images: list[np.ndarray] = []
        index: dict[str, int] = {}
        for corners, name, glow in self._faces:
            texture = self._made.get(name) or make_texture(name)
            if name not in index:
                index[name] = first_texture + len(images)
                images.append(texture.image)
            builder.add(corners, _uv(corners, texture), index[name], glow=glow)
        mesh, samples, fixed = builder.build()
        light = bake(samples, self.lamps, AMBIENT, self.solids)
        mesh.light[:] = np.where(np.isnan(fixed), light, fixed)
        return mesh, images


def _uv(corners_m: np.ndarray, texture: Texture) -> np.ndarray:
    """Texture coordinates (4, 2) of a rectangle, in repeats; rows run down."""
    width, height = (float(np.linalg.norm(corners_m[k] - corners_m[0])) for k in (1, 3))
    u = width / texture.size_m[0] if texture.size_m[0] else 1.0
    v = height / texture.size_m[1] if texture.size_m[1] else 1.0
    return np.array([[0.0, v], [u, v], [u, 0.0], [0.0, 0.0]])


def docked_pose(dock: SE2, robot: RobotConfig) -> SE2:
    """Where the robot stands when its front touches the dock's plate."""
    return dock @ SE2(DOCK_PLATE_M + robot.radius_m, 0.0, math.pi)
