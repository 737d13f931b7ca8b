"""What the renderer draws: textured triangles, each face with its own small light map.

`MeshBuilder` collects planar faces; `build` triangulates them and lays a grid of light samples
over each, to be filled by `lighting.bake`.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """Triangles in the world (metres, z up), counter-clockwise seen from their outside.

    `uv` counts repeats of the texture. `light_uv` are texels within the face's light map, which
    starts at `light_map[:, 0]` of `light` and has `light_map[:, 1]` columns and `[:, 2]` rows.
    """

    vertices_m: np.ndarray  # (n, 3, 3) float32
    uv: np.ndarray  # (n, 3, 2) float32
    texture: np.ndarray  # (n,) int32
    one_sided: np.ndarray  # (n,) bool: not drawn from behind
    light_uv: np.ndarray  # (n, 3, 2) float32
    light_map: np.ndarray  # (n, 3) int32
    light: np.ndarray  # (m,) float32, factor on the texture's grey


@dataclass(frozen=True, slots=True, eq=False)
class LightSamples:
    """Where the light maps of a mesh want to know their light: points and normals (m, 3)."""

    points_m: np.ndarray
    normals: np.ndarray
    two_sided: np.ndarray  # (m,) bool


@dataclass(slots=True)
class _Face:
    corners_m: np.ndarray
    uv: np.ndarray
    texture: int
    one_sided: bool
    glow: float


@dataclass(slots=True)
class MeshBuilder:
    """Collects planar convex faces (or triangle soups) and makes a `Mesh` of them."""

    light_step_m: float = 0.08
    faces: list[_Face] = field(default_factory=list)

    def add(
        self,
        corners_m: np.ndarray,
        uv: np.ndarray,
        texture: int,
        one_sided: bool = True,
        glow: float = 0.0,
    ) -> None:
        """Add a convex planar face: corners (k, 3) counter-clockwise from outside, uv (k, 2).

        A positive `glow` is its fixed light, whatever shines on it (a window).
        """
        self.faces.append(
            _Face(np.asarray(corners_m, np.float64), np.asarray(uv), texture, one_sided, glow)
        )

    def build(self) -> tuple[Mesh, LightSamples, np.ndarray]:
        """Mesh (light all 1), its light samples, and fixed light (m,), NaN where there is none."""
        vertices, uv, texture, one_sided, light_uv, light_map = [], [], [], [], [], []
        points, normals, two_sided, fixed = [], [], [], []
        offset = 0
        for face in self.faces:
            grid, normal, texels, columns, rows = _light_grid(face.corners_m, self.light_step_m)
            for k in range(1, len(face.corners_m) - 1):
                pick = [0, k, k + 1]
                vertices.append(face.corners_m[pick])
                uv.append(face.uv[pick])
                light_uv.append(texels[pick])
                texture.append(face.texture)
                one_sided.append(face.one_sided)
                light_map.append((offset, columns, rows))
            offset += len(grid)
            points.append(grid)
            normals.append(np.broadcast_to(normal, grid.shape))
            two_sided.append(np.full(len(grid), not face.one_sided))
            fixed.append(np.full(len(grid), face.glow if face.glow > 0 else np.nan))
        mesh = Mesh(
            np.array(vertices, np.float32),
            np.array(uv, np.float32),
            np.array(texture, np.int32),
            np.array(one_sided, np.bool_),
            np.array(light_uv, np.float32),
            np.array(light_map, np.int32),
            np.ones(offset, np.float32),
        )
        samples = LightSamples(
            np.concatenate(points), np.concatenate(normals), np.concatenate(two_sided)
        )
        return mesh, samples, np.concatenate(fixed)


def _light_grid(
    corners_m: np.ndarray, step_m: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, int, int]:
    """Sample points over a face, its normal, its corners in texels, and the grid's size."""
    along = corners_m[1] - corners_m[0]
    along = along / (np.linalg.norm(along) + 1e-12)
    normal = np.cross(along, corners_m[2] - corners_m[0])
    normal = normal / (np.linalg.norm(normal) + 1e-12)
    across = np.cross(normal, along)
    a, b = (corners_m - corners_m[0]) @ along, (corners_m - corners_m[0]) @ across
    columns = max(2, int(np.ceil((a.max() - a.min()) / step_m)) + 1)
    rows = max(2, int(np.ceil((b.max() - b.min()) / step_m)) + 1)
    # Pulled in by a millimetre, so that a sample does not lie inside the neighbouring solid.
    edge_a, edge_b = min(1e-3, 0.4 * np.ptp(a)), min(1e-3, 0.4 * np.ptp(b))
    at_a = np.linspace(a.min() + edge_a, a.max() - edge_a, columns)
    at_b = np.linspace(b.min() + edge_b, b.max() - edge_b, rows)
    grid = corners_m[0] + at_b[:, None, None] * across + at_a[None, :, None] * along + 2e-3 * normal
    texels = np.stack(
        [
            (a - a.min()) / max(np.ptp(a), 1e-9) * (columns - 1),
            (b - b.min()) / max(np.ptp(b), 1e-9) * (rows - 1),
        ],
        axis=-1,
    )
    return grid.reshape(-1, 3), normal, texels, columns, rows
