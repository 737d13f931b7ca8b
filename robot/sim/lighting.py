"""Light for the mesh, computed once when a scene is drawn: lamps with shadows, and corners' gloom.

Lambert's law with inverse-square lamps and soft shadows from a few points per lamp, plus ambient
light dimmed by near solids (Landis, "Production-ready global illumination", 2002). Rays are
clipped against convex upright prisms (Cyrus and Beck, Computers & Graphics 1978).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from robot.sim.mesh import LightSamples

_LAMP_RADIUS_M = 0.18
_LAMP_POINTS = 4
_SKY_RAYS = 8
_SKY_REACH_M = 0.5


@dataclass(frozen=True, slots=True)
class Lamp:
    """A bright ball; `power` is roughly the light that it throws on a face one metre below."""

    x_m: float
    y_m: float
    z_m: float
    power: float


@dataclass(frozen=True, slots=True, eq=False)
class Solid:
    """Something that throws a shadow: a convex outline (k, 2), counter-clockwise from above."""

    outline_m: np.ndarray
    low_m: float
    high_m: float


@njit(cache=True, fastmath=True, nogil=True, error_model="numpy")
def _blocked(px, py, pz, dx, dy, dz, reach, points, first, low, high, disc):  # type: ignore[no-untyped-def]
    """Does anything stand between the point and `reach` times the direction?"""
    flat = dx * dx + dy * dy
    for i in range(len(first) - 1):
        # Quick refusal: the disc around the outline against the segment's line and ends.
        ox, oy = disc[i, 0] - px, disc[i, 1] - py
        radius = disc[i, 2]
        s = min(max((ox * dx + oy * dy) / flat, 0.0), reach) if flat > 0.0 else 0.0
        ex, ey = ox - s * dx, oy - s * dy
        if ex * ex + ey * ey > radius * radius:
            continue
        enter, leave = 0.0, reach
        if dz != 0.0:
            a, b = (low[i] - pz) / dz, (high[i] - pz) / dz
            enter, leave = max(enter, min(a, b)), min(leave, max(a, b))
        elif pz < low[i] or pz > high[i]:
            continue
        if enter >= leave:
            continue
        n = first[i + 1] - first[i]
        for k in range(n):
            x0, y0 = points[first[i] + k, 0], points[first[i] + k, 1]
            j = first[i] + (k + 1) % n
            nx, ny = points[j, 1] - y0, x0 - points[j, 0]  # outward
            distance = nx * (px - x0) + ny * (py - y0)
            speed = nx * dx + ny * dy
            if speed == 0.0:
                if distance > 0.0:
                    enter = leave
                    break
            elif speed < 0.0:
                enter = max(enter, -distance / speed)
            else:
                leave = min(leave, -distance / speed)
            if enter >= leave:
                break
        if leave - enter > 1e-4:
            return True
    return False


@njit(cache=True, fastmath=True, nogil=True, error_model="numpy")
def _bake(  # type: ignore[no-untyped-def]
    position, normal, two_sided, lamps, ambient, lamp_points, sky, points, first, low, high, disc,
    light,
):  # fmt: skip
    for m in range(len(position)):
        px, py, pz = position[m, 0], position[m, 1], position[m, 2]
        nx, ny, nz = normal[m, 0], normal[m, 1], normal[m, 2]
        open_sky = len(sky)
        if len(first) > 1:
            for r in range(len(sky)):
                dx, dy, dz = sky[r, 0], sky[r, 1], sky[r, 2]
                facing = dx * nx + dy * ny + dz * nz
                if facing < 0.0:  # mirrored into the face's half-space
                    dx, dy, dz = dx - 2 * facing * nx, dy - 2 * facing * ny, dz - 2 * facing * nz
                if _blocked(px, py, pz, dx, dy, dz, _SKY_REACH_M, points, first, low, high, disc):
                    open_sky -= 1
        total = ambient * (0.35 + 0.65 * open_sky / len(sky))
        for k in range(len(lamps)):
            for r in range(len(lamp_points)):
                ax = lamps[k, 0] + lamp_points[r, 0] - px
                ay = lamps[k, 1] + lamp_points[r, 1] - py
                az = lamps[k, 2] + lamp_points[r, 2] - pz
                square = ax * ax + ay * ay + az * az
                cosine = (ax * nx + ay * ny + az * nz) / math.sqrt(square)
                if two_sided[m]:
                    cosine = abs(cosine)
                gain = cosine * lamps[k, 3] / (square + 0.2)
                if gain < 0.004:
                    continue
                if len(first) > 1 and _blocked(
                    px, py, pz, ax, ay, az, 1.0, points, first, low, high, disc
                ):
                    continue
                total += gain / len(lamp_points)
        light[m] = total


def bake(
    samples: LightSamples, lamps: list[Lamp], ambient: float, solids: list[Solid]
) -> np.ndarray:
    """Light (m,) float32 at the samples; `solids` throw the shadows."""
    points = [solid.outline_m for solid in solids]
    first = np.cumsum([0, *(len(p) for p in points)])
    disc = np.zeros((len(solids), 3))
    for i, outline in enumerate(points):
        centre = outline.mean(axis=0)
        disc[i] = *centre, np.hypot(*(outline - centre).T).max()
    light = np.empty(len(samples.points_m), np.float32)
    _bake(
        samples.points_m,
        samples.normals,
        samples.two_sided,
        np.array([[p.x_m, p.y_m, p.z_m, p.power] for p in lamps]).reshape(-1, 4),
        ambient,
        _sphere(_LAMP_POINTS) * _LAMP_RADIUS_M,
        _sphere(_SKY_RAYS),
        np.concatenate(points) if points else np.zeros((0, 2)),
        first,
        np.array([solid.low_m for solid in solids]),
        np.array([solid.high_m for solid in solids]),
        disc,
        light,
    )
    return light


def _sphere(count: int) -> np.ndarray:
    """Directions (count, 3) spread evenly over the sphere (golden spiral)."""
    k = np.arange(count) + 0.5
    z = 1.0 - 2.0 * k / count
    turn = np.pi * (1.0 + 5.0**0.5) * k
    r = np.sqrt(1.0 - z * z)
    return np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=-1)
