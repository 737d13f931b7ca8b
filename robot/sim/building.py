"""Builds rooms out of boxes: every solid gives faces to draw and, where it stands, an outline."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from robot.config import RobotConfig
from robot.geometry.se2 import SE2
from robot.sim.mesh import Mesh, MeshBuilder
from robot.sim.renderer import TextureAtlas
from robot.sim.textures import Texture, make_texture, marker

LOWEST_BUMP_M, HIGHEST_BUMP_M = 0.02, 0.10  # between these heights a thing is in the robot's way
LIGHT_STEP_M = 0.25
DOCK_PLATE_M = 0.09  # the plate reaches this far out from the marker's face
DOCK_WIDTH_M, DOCK_HEIGHT_M, PLATE_HEIGHT_M, PANEL_THICK_M = 0.20, 0.17, 0.03, 0.03
MARKER_CENTRE_M = 0.09  # above the floor: the height of the eyes
MARKER_MARGIN = 0.12  # white border, as a share of the printed side
AMBIENT, SKY = 0.55, 0.25


@dataclass(slots=True)
class Building:
    """Collects solids; `finish` gives mesh and textures."""

    builder: MeshBuilder = field(default_factory=lambda: MeshBuilder(light_step_m=LIGHT_STEP_M))
    images: list[np.ndarray] = field(default_factory=list)
    obstacles: list[np.ndarray] = field(default_factory=list)
    lamps_m: list[tuple[float, float, float]] = field(default_factory=list)
    _textures: dict[str, int] = field(default_factory=dict)

    def texture(self, name: str, texture: Texture | None = None) -> tuple[int, Texture]:
        """Index of a texture, made once."""
        made = texture or make_texture(name)
        if name not in self._textures:
            self._textures[name] = len(self.images)
            self.images.append(made.image)
        return self._textures[name], made

    def face(self, corners_m: np.ndarray, name: str, *, glow: float = 0.0) -> None:
        """A rectangle (4, 3), counter-clockwise from outside, its first edge along the bottom."""
        index, texture = self.texture(name)
        width = float(np.linalg.norm(corners_m[1] - corners_m[0]))
        height = float(np.linalg.norm(corners_m[3] - corners_m[0]))
        u = width / texture.size_m[0] if texture.size_m[0] else 1.0
        v = height / texture.size_m[1] if texture.size_m[1] else 1.0
        self.builder.add(corners_m, np.array([[0, v], [u, v], [u, 0], [0, 0]]), index, glow=glow)

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
        ring = [outline[k] for k in range(4)]
        self.face(np.array([[*p, high] for p in ring]), name)
        if low > 0:
            self.face(np.array([[*p, low] for p in reversed(ring)]), name)
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

    def finish(self) -> tuple[Mesh, TextureAtlas]:
        """The mesh with its light, and its textures."""
        mesh, samples, fixed = self.builder.build()
        light = shine(samples.points_m, samples.normals, np.array(self.lamps_m).reshape(-1, 3))
        mesh.light[:] = np.where(np.isnan(fixed), light, fixed)
        return mesh, TextureAtlas.pack(self.images)


def shine(points_m: np.ndarray, normals: np.ndarray, lamps_m: np.ndarray) -> np.ndarray:
    """Light (n,) at points (n, 3): ambient, brighter from above, and Lambert's law for lamps."""
    light = AMBIENT + SKY * 0.5 * (1.0 + normals[:, 2])
    for lamp in lamps_m:
        ray = lamp - points_m
        far2 = np.sum(ray * ray, axis=1)
        cosine = np.sum(ray * normals, axis=1) / np.sqrt(far2)
        light += 1.1 * np.maximum(cosine, 0.0) / (1.0 + far2)
    return light.astype(np.float32)


def along(start: SE2, length_m: float) -> tuple[float, float]:
    """The point `length_m` ahead of a pose."""
    return (
        start.x_m + length_m * math.cos(start.yaw_rad),
        start.y_m + length_m * math.sin(start.yaw_rad),
    )


def docked_pose(dock: SE2, robot: RobotConfig) -> SE2:
    """Where the robot stands when its front touches the dock's plate."""
    return dock @ SE2(DOCK_PLATE_M + robot.radius_m, 0.0, math.pi)


def build_dock(building: Building, dock: SE2, robot: RobotConfig) -> None:
    """A panel with the marker, and a low plate with the charge contacts in front of it."""
    back = dock @ SE2(-PANEL_THICK_M / 2, 0.0, 0.0)
    building.box(back, (PANEL_THICK_M, DOCK_WIDTH_M, DOCK_HEIGHT_M), "dark_wood:7")
    plate = dock @ SE2(DOCK_PLATE_M / 2, 0.0, 0.0)
    building.box(plate, (DOCK_PLATE_M, DOCK_WIDTH_M, PLATE_HEIGHT_M), "metal:2")
    side = robot.dock_marker_size_m * (1.0 + 2.0 * MARKER_MARGIN)
    index, _ = building.texture("marker", marker(robot.dock_marker_id, MARKER_MARGIN))
    ends = (dock @ SE2(0.001, 0.0, 0.0)).apply(np.array([[0.0, -side / 2], [0.0, side / 2]]))
    low, high = MARKER_CENTRE_M - side / 2, MARKER_CENTRE_M + side / 2
    corners = np.array([[*ends[0], low], [*ends[1], low], [*ends[1], high], [*ends[0], high]])
    building.builder.add(corners, np.array([[0, 1], [1, 1], [1, 0], [0, 0]]), index, glow=1.0)
