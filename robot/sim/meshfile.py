"""Worlds from GLB and OBJ files (metres, z up, floor at z = 0), read by trimesh."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from robot.config import RobotConfig
from robot.errors import MissingExtraError, SceneError
from robot.geometry.se2 import SE2
from robot.sim.building import (
    AMBIENT,
    HIGHEST_BUMP_M,
    LAMP_POWER,
    LOWEST_BUMP_M,
    Building,
    docked_pose,
)
from robot.sim.lighting import Lamp, bake
from robot.sim.mesh import LightSamples, Mesh, MeshBuilder
from robot.sim.renderer import TextureAtlas
from robot.sim.world import World

LAMP_HEIGHT_M, LAMP_EVERY_M = 2.2, 3.5
DIM = 0.7  # textures of meshes are brighter than ours
PLAIN_GREY = 150
LARGE_M = 0.3  # triangles beyond this edge length have light between their corners
APPROACH_M = 0.9  # free floor wanted in front of the dock
MAX_TEXTURE_PX = 512


def load_mesh_world(
    path: Path, robot: RobotConfig, dock: SE2 | None = None, extra: Building | None = None
) -> World:
    """The world in a mesh file, with `extra` solids in it.

    Without `dock`, the dock is put against a wall with free floor before it. Raises SceneError
    when the file cannot be read or has no place for a dock, MissingExtraError without trimesh.
    """
    triangles, uv, texture, images = _read(path)
    building = extra or Building()
    obstacles = (*slab_outlines(triangles), *building.obstacles)
    if not obstacles:
        raise SceneError(
            f"scene {path} has nothing that stands on a floor at z = 0; export it in metres, z up."
        )
    dock = dock or _place_dock(World(path.name, obstacles, (), SE2(), SE2(), building.draw), robot)
    own = len(building.obstacles)
    building.dock(dock, robot)

    def draw() -> tuple[Mesh, TextureAtlas]:
        fittings, more = building.mesh(len(images))
        mesh = _join(_lit(triangles, uv, texture), fittings)
        return mesh, TextureAtlas.pack([*images, *more])

    return World(
        path.name,
        (*obstacles, *building.obstacles[own:]),
        (),
        dock,
        docked_pose(dock, robot),
        draw,
    )


def _read(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[np.ndarray]]:
    """(triangles (n, 3, 3), uv (n, 3, 2), texture (n,), grey images)."""
    try:
        import trimesh
    except ImportError:
        raise MissingExtraError(
            f"scene {path}: reading meshes needs trimesh; pip install 'sweeper[sim]'."
        ) from None
    if not path.is_file():
        raise SceneError(f"scene {path} does not exist; give an existing GLB or OBJ file.")
    try:
        scene: Any = trimesh.load_scene(path)
        parts = [
            (scene.geometry[key], scene.graph.get(node)[0])
            for node in scene.graph.nodes_geometry
            for key in [scene.graph.get(node)[1]]
        ]
    except Exception as error:  # trimesh raises whatever its parsers meet
        raise SceneError(
            f"scene {path} is not a readable mesh ({error}); export it again as GLB."
        ) from None
    triangles, uv, texture = [], [], []
    images: list[np.ndarray] = []
    for geometry, world_from_part in parts:
        corners = trimesh.transform_points(geometry.vertices, world_from_part)
        triangles.append(corners[geometry.faces])
        image, corners_uv = _surface(geometry)
        uv.append(corners_uv[geometry.faces])
        texture.append(np.full(len(geometry.faces), len(images), np.int32))
        images.append(image)
    if not triangles:
        raise SceneError(f"scene {path} has no triangles; export its meshes too.")
    return np.concatenate(triangles), np.concatenate(uv), np.concatenate(texture), images


def _surface(geometry: Any) -> tuple[np.ndarray, np.ndarray]:
    """Grey texture (h, w) and uv (vertices, 2) of a part; plain grey where it has none."""
    visual = geometry.visual
    material = getattr(visual, "material", None)
    picture = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
    uv = getattr(visual, "uv", None)
    if picture is None or uv is None:
        colour = getattr(material, "main_color", None)
        grey = PLAIN_GREY if colour is None else int(np.mean(colour[:3]))
        return np.full((4, 4), grey, np.uint8), np.zeros((len(geometry.vertices), 2))
    image = np.asarray(picture.convert("L"))
    scale = MAX_TEXTURE_PX / max(image.shape)
    if scale < 1.0:
        image = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    return image, np.stack([uv[:, 0], 1.0 - uv[:, 1]], axis=1)


def _lit(triangles: np.ndarray, uv: np.ndarray, texture: np.ndarray) -> Mesh:
    """A mesh in the light of lamps spread under the ceiling; its solids throw no shadows.

    Large triangles get a grid of light, small ones the light of their corners.
    """
    low, high = triangles.reshape(-1, 3).min(axis=0), triangles.reshape(-1, 3).max(axis=0)
    lamps = [
        Lamp(x, y, LAMP_HEIGHT_M, LAMP_POWER)
        for x in np.arange(low[0] + LAMP_EVERY_M / 2, high[0], LAMP_EVERY_M)
        for y in np.arange(low[1] + LAMP_EVERY_M / 2, high[1], LAMP_EVERY_M)
    ]
    edges = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2)
    large = edges.max(axis=1) > LARGE_M
    small = _small(triangles[~large], uv[~large], texture[~large], lamps)
    if not large.any():
        return small
    builder = MeshBuilder(light_step_m=LARGE_M)
    for corners, corners_uv, index in zip(triangles[large], uv[large], texture[large], strict=True):
        builder.add(corners, corners_uv, int(index), one_sided=False)
    grid, samples, _ = builder.build()
    grid.light[:] = DIM * bake(samples, lamps, AMBIENT, [])
    return _join(small, grid)


def _small(triangles: np.ndarray, uv: np.ndarray, texture: np.ndarray, lamps: list[Lamp]) -> Mesh:
    """Triangles whose light is linear between their corners: maps of 2 x 2 texels."""
    count = len(triangles)
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True) + 1e-12
    samples = LightSamples(
        triangles.reshape(-1, 3), np.repeat(normals, 3, axis=0), np.ones(3 * count, np.bool_)
    )
    corner = DIM * bake(samples, lamps, AMBIENT, []).reshape(-1, 3)
    maps = np.stack([4 * np.arange(count), np.full(count, 2), np.full(count, 2)], axis=1)
    texels = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], np.float32)
    return Mesh(
        triangles.astype(np.float32),
        uv.astype(np.float32),
        texture,
        np.zeros(count, np.bool_),
        np.broadcast_to(texels, (count, 3, 2)).copy(),
        maps.astype(np.int32),
        np.column_stack([corner, corner[:, 1] + corner[:, 2] - corner[:, 0]]).ravel(),
    )


def _join(a: Mesh, b: Mesh) -> Mesh:
    shifted = b.light_map + np.array([len(a.light), 0, 0], np.int32)
    return Mesh(
        np.concatenate([a.vertices_m, b.vertices_m]),
        np.concatenate([a.uv, b.uv]),
        np.concatenate([a.texture, b.texture]),
        np.concatenate([a.one_sided, b.one_sided]),
        np.concatenate([a.light_uv, b.light_uv]),
        np.concatenate([a.light_map, shifted]),
        np.concatenate([a.light, b.light]),
    )


def slab_outlines(triangles: np.ndarray) -> tuple[np.ndarray, ...]:
    """Seen from above, the part of each triangle that is in the robot's way: convex (k, 2)."""
    z = triangles[:, :, 2]
    crossing = (z.max(axis=1) > LOWEST_BUMP_M) & (z.min(axis=1) < HIGHEST_BUMP_M)
    outlines = []
    for triangle in triangles[crossing]:
        part = _clip(_clip(triangle, LOWEST_BUMP_M, 1.0), HIGHEST_BUMP_M, -1.0)
        if len(part) >= 2 and np.ptp(part[:, :2], axis=0).max() > 1e-3:
            outlines.append(part[:, :2])
    return tuple(outlines)


def _clip(polygon: np.ndarray, height_m: float, side: float) -> np.ndarray:
    """Keep what is above (side 1) or below (side -1) a height (Sutherland and Hodgman, 1974)."""
    kept = []
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        da, db = side * (a[2] - height_m), side * (b[2] - height_m)
        if da >= 0:
            kept.append(a)
        if (da >= 0) != (db >= 0):
            kept.append(a + da / (da - db) * (b - a))
    return np.array(kept).reshape(-1, 3)


def _place_dock(world: World, robot: RobotConfig, resolution_m: float = 0.02) -> SE2:
    """A wall with free floor before it, nearest to the roomiest place.

    Raises SceneError when there is none.
    """
    occupied, x0, y0 = world.occupancy(resolution_m)
    clearance = cv2.distanceTransform((~occupied).astype(np.uint8), cv2.DIST_L2, 5) * resolution_m
    outside = np.ones_like(occupied)
    outside[1:-1, 1:-1] = False
    _, labels = cv2.connectedComponents((~occupied).astype(np.uint8), connectivity=4)
    clearance[np.isin(labels, np.unique(labels[outside]))] = 0.0
    row, column = np.unravel_index(int(clearance.argmax()), clearance.shape)
    candidates = []
    for yaw_rad in (0.0, math.pi / 2, math.pi, -math.pi / 2):
        step = np.array([math.sin(yaw_rad), math.cos(yaw_rad)])
        cells = np.rint(np.array([row, column]) - np.outer(np.arange(2000), step)).astype(int)
        inside = ((cells >= 0) & (cells < occupied.shape)).all(axis=1)
        cells = cells[: int(np.argmin(inside)) if not inside.all() else None]
        hits = np.flatnonzero(occupied[tuple(cells.T)])
        if not len(hits):
            continue
        far_m = hits[0] * resolution_m
        at = cells[hits[0]] * resolution_m + np.array([y0, x0])
        dock = SE2(float(at[1]), float(at[0]), yaw_rad) @ SE2(0.07, 0.0, 0.0)
        if far_m > APPROACH_M and _is_free(clearance, dock, robot, (x0, y0), resolution_m):
            candidates.append((far_m, dock))
    if not candidates:
        raise SceneError(
            f"scene {world.name} has no wall with {APPROACH_M} m of free floor before it; give a "
            "TOML scene with a [dock] instead."
        )
    return min(candidates, key=lambda c: c[0])[1]


def _is_free(
    clearance: np.ndarray,
    dock: SE2,
    robot: RobotConfig,
    origin_m: tuple[float, float],
    resolution_m: float,
) -> bool:
    """Whether the robot fits all along the approach."""
    start = docked_pose(dock, robot)
    for back_m in np.arange(0.05, APPROACH_M, 0.05):
        at = start @ SE2(-float(back_m), 0.0, 0.0)
        row = int((at.y_m - origin_m[1]) / resolution_m)
        column = int((at.x_m - origin_m[0]) / resolution_m)
        if not (0 <= row < clearance.shape[0] and 0 <= column < clearance.shape[1]):
            return False
        if clearance[row, column] < robot.radius_m + 0.02:
            return False
    return True
