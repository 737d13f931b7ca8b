"""A textured box room, ray-cast with NumPy: exact images and disparity for the tests.

The floor is z = 0, walls stand at x = +-`HALF_X_M`, y = +-`HALF_Y_M`; one box may stand in it.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from robot.geometry.se2 import SE2
from robot.geometry.stereo import StereoCamera, base_from_cam

HALF_X_M, HALF_Y_M = 2.5, 2.0
TEXELS_PER_M = 256
SIZE = 1024  # texels of a texture, which then repeats


def camera(width: int = 320, height: int = 240, focal: float = 228.0) -> StereoCamera:
    """The robot's usual camera."""
    mount = base_from_cam(0.13, 0.03, 0.09)
    return StereoCamera(width, height, focal, (width - 1) / 2, (height - 1) / 2, 0.06, mount)


def texture(seed: int, contrast: float = 45.0) -> np.ndarray:
    """Noise of several grains, (SIZE, SIZE), from finest blobs of 2 texels to coarse ones."""
    rng = np.random.default_rng(seed)
    total = np.zeros((SIZE, SIZE), np.float32)
    for grain in (2, 4, 8, 16, 32):
        noise = rng.standard_normal((SIZE // grain, SIZE // grain)).astype(np.float32)
        total += cv2.resize(noise, (SIZE, SIZE), interpolation=cv2.INTER_CUBIC)
    return np.asarray(120.0 + contrast * total / total.std())


TEXTURES = tuple(texture(seed) for seed in range(6))
PLAIN = np.full((SIZE, SIZE), 120.0, np.float32)


@dataclass(frozen=True)
class Box:
    """An upright box: x and y ranges in the room, and its height."""

    x: tuple[float, float]
    y: tuple[float, float]
    height_m: float


def render(
    eye: StereoCamera,
    pose: SE2,
    *,
    box: Box | None = None,
    plain_walls: bool = False,
    noise: float = 1.0,
    seed: int = 0,
    right_gain: float = 1.0,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Left and right grey images (uint8) and the true disparity (float32) from a base pose."""
    rng = np.random.default_rng(seed)
    walls = (PLAIN,) * 4 if plain_walls else TEXTURES[1:5]
    images = []
    for side in (0.0, eye.baseline_m):
        grey, depth = _cast(eye, pose, side, (TEXTURES[0], *walls, TEXTURES[5]), box)
        gain = right_gain if side else 1.0
        grey = grey * gain + noise * rng.standard_normal(grey.shape)
        images.append(np.clip(np.rint(grey), 0, 255).astype(np.uint8))
        if not side:
            disparity = (eye.focal_px * eye.baseline_m / depth).astype(np.float32)
    return images[0], images[1], disparity


def _cast(
    eye: StereoCamera,
    pose: SE2,
    shift_m: float,
    textures: tuple[np.ndarray, ...],
    box: Box | None,
) -> tuple[np.ndarray, np.ndarray]:
    v, u = np.mgrid[0 : eye.height_px, 0 : eye.width_px]
    rays = np.stack(
        [(u - eye.cx_px) / eye.focal_px, (v - eye.cy_px) / eye.focal_px, np.ones(u.shape)], axis=-1
    )
    rays = rays @ eye.base_from_cam[:3, :3].T
    origin = eye.base_from_cam[:3, 3] + eye.base_from_cam[:3, 0] * shift_m
    c, s = np.cos(pose.yaw_rad), np.sin(pose.yaw_rad)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    rays, origin = rays @ turn.T, turn @ origin + np.array([pose.x_m, pose.y_m, 0.0])
    depth = np.full(u.shape, np.inf)
    grey = np.full(u.shape, 200.0, np.float32)
    planes = [(2, 0.0), (0, HALF_X_M), (0, -HALF_X_M), (1, HALF_Y_M), (1, -HALF_Y_M)]
    for (axis, at), pattern in zip(planes, textures, strict=False):
        _hit(rays, origin, axis, at, None, pattern, depth, grey)
    if box is not None:
        for axis, ends in ((0, box.x), (1, box.y)):
            for at in ends:
                _hit(rays, origin, axis, at, box, textures[5], depth, grey)
        _hit(rays, origin, 2, box.height_m, box, textures[5], depth, grey)
    return grey, depth


def _hit(
    rays: np.ndarray,
    origin: np.ndarray,
    axis: int,
    at: float,
    box: Box | None,
    pattern: np.ndarray,
    depth: np.ndarray,
    grey: np.ndarray,
) -> None:
    """Draw one plane (or face of the box) where it is nearer than what is drawn."""
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (at - origin[axis]) / rays[..., axis]  # the camera's z: rays have z = 1 there
        place = origin + distance[..., None] * rays
    new = (distance > 0.01) & (distance < depth)
    if box is not None:
        inside = [
            (place[..., 0] >= box.x[0] - 1e-9) & (place[..., 0] <= box.x[1] + 1e-9),
            (place[..., 1] >= box.y[0] - 1e-9) & (place[..., 1] <= box.y[1] + 1e-9),
            (place[..., 2] >= -1e-9) & (place[..., 2] <= box.height_m + 1e-9),
        ]
        new &= np.all(inside, axis=0)
    others = [k for k in range(3) if k != axis]
    texel = np.nan_to_num(place[..., others], posinf=0, neginf=0) * TEXELS_PER_M % (SIZE - 1.0)
    seen = cv2.remap(
        pattern,
        texel[..., 0].astype(np.float32),
        texel[..., 1].astype(np.float32),
        cv2.INTER_LINEAR,
    )
    depth[new] = distance[new]
    grey[new] = seen[new]
