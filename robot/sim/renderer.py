"""Renders a mesh to grey images with exact depth, on one core and with nothing but numba."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from robot.sim import raster
from robot.sim.mesh import Mesh

_MAX_LEVELS = 12


@dataclass(frozen=True, slots=True, eq=False)
class TextureAtlas:
    """Mip pyramids of all textures in one array of bytes."""

    texels: np.ndarray  # (n,) uint8
    offsets: np.ndarray  # (textures, levels) int64
    log2_size: np.ndarray  # (textures, 2) int64: columns, rows
    levels: np.ndarray  # (textures,) int64

    @classmethod
    def pack(cls, images: list[np.ndarray]) -> TextureAtlas:
        """Build pyramids from grey uint8 images; sides are resized to powers of two."""
        offsets = np.zeros((len(images), _MAX_LEVELS), np.int64)
        log2_size = np.zeros((len(images), 2), np.int64)
        levels = np.zeros(len(images), np.int64)
        chunks: list[np.ndarray] = []
        offset = 0
        for i, image in enumerate(images):
            log2 = [round(float(np.log2(side))) for side in image.shape[1::-1]]
            log2 = [min(side, _MAX_LEVELS - 1) for side in log2]
            size = (1 << log2[0], 1 << log2[1])
            if image.shape[1::-1] != size:
                image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
            log2_size[i] = log2
            while True:
                offsets[i, levels[i]] = offset
                levels[i] += 1
                chunks.append(image.ravel())
                offset += image.size
                if image.size == 1:
                    break
                half = (max(image.shape[1] // 2, 1), max(image.shape[0] // 2, 1))
                image = cv2.resize(image, half, interpolation=cv2.INTER_AREA).reshape(half[::-1])
        return cls(np.concatenate(chunks), offsets, log2_size, levels)


class Renderer:
    """A pinhole eye in a mesh. Not thread-safe: buffers are reused between pictures."""

    def __init__(
        self, mesh: Mesh, atlas: TextureAtlas, width_px: int, height_px: int, anisotropy: int = 8
    ) -> None:
        n = len(mesh.vertices_m)
        self._mesh, self._atlas, self._anisotropy = mesh, atlas, anisotropy
        self._size = np.array([width_px, height_px], np.float64)
        self._texture_size = (1 << atlas.log2_size).astype(np.float64)
        self._corners = np.empty((2 * n, 9))
        self._owner = np.empty(2 * n, np.int32)
        self._planes = np.empty((n, raster.PLANES))
        self._source = np.empty(n, np.int32)
        self._nearest = np.empty((raster.SAMPLES, height_px, width_px), np.float32)
        self._visible = np.empty((raster.SAMPLES, height_px, width_px), np.int32)

    def render(
        self,
        world_from_cam: np.ndarray,
        focal_px: float,
        cx_px: float,
        cy_px: float,
        background: float = 0.0,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Picture taken from `world_from_cam` (4, 4; x right, y down, z forward).

        Returns (grey, inverse_depth), float32 (h, w): grey is light times texture, not clipped;
        inverse depth along z in 1/m, at the pixel's centre, 0 where nothing is seen.
        """
        mesh, atlas = self._mesh, self._atlas
        rotation = np.ascontiguousarray(world_from_cam[:3, :3].T)
        eye = np.ascontiguousarray(world_from_cam[:3, 3])
        lens = np.array([focal_px, cx_px, cy_px])
        count, _ = raster.project(
            mesh.vertices_m, mesh.uv, mesh.light_uv, self._texture_size, mesh.texture,
            mesh.one_sided, rotation, eye, lens, self._size,
            self._corners, self._owner, self._planes, self._source,
        )  # fmt: skip
        raster.rasterise(
            self._corners, self._owner, count, self._planes, self._nearest, self._visible
        )
        grey = np.empty(self._nearest.shape[1:], np.float32)
        inverse_depth = np.empty_like(grey)
        raster.shade(
            self._visible, self._planes, self._source, mesh.texture, atlas.texels, atlas.offsets,
            atlas.log2_size, atlas.levels, mesh.light_map, mesh.light, self._anisotropy,
            background, grey, inverse_depth,
        )  # fmt: skip
        return grey, inverse_depth
