"""Boxes, sheets and furniture of random textures, collected into a lit mesh."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robot.sim.mesh import LightSamples, Mesh, MeshBuilder

LIGHT_STEP_M = 0.3


def unit_yaw(yaw: float) -> np.ndarray:
    """Rotation (3, 3) about z."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def rotation(rng: np.random.Generator, amount: float) -> np.ndarray:
    """Random rotation (3, 3): uniform for amount 1, small turns for a small amount."""
    w, x, y, z = rng.standard_normal(4) * (1, amount, amount, amount)
    n = w * w + x * x + y * y + z * z
    w, x, y, z = (v / np.sqrt(n) for v in (w, x, y, z))
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def light(rng: np.random.Generator, samples: LightSamples) -> np.ndarray:
    """Lambert light (m,) of an ambient part and a few lamps, without shadows."""
    points, normals = samples.points_m, samples.normals
    total = np.full(len(points), rng.uniform(0.3, 0.9))
    spread = np.abs(points).max(0)
    for _ in range(int(rng.integers(1, 4))):
        lamp = rng.uniform(-0.7, 0.9, 3) * spread
        toward = lamp - points
        distance = np.linalg.norm(toward, axis=1) + 0.2
        cosine = np.einsum("ij,ij->i", toward, normals) / distance
        facing = np.where(samples.two_sided, np.abs(cosine), np.maximum(cosine, 0))
        reach = rng.uniform(0.5, 2.0)
        total += rng.uniform(0.2, 0.8) * facing * reach**2 / (reach**2 + distance**2)
    return total.astype(np.float32)


class Solids:
    """Collects textured solids; textures are drawn at random out of `textures` of them."""

    def __init__(self, rng: np.random.Generator, textures: int) -> None:
        self.rng, self.textures = rng, textures
        self.builder = MeshBuilder(light_step_m=LIGHT_STEP_M)

    def _texture(self) -> int:
        return int(self.rng.integers(self.textures))

    def quad(
        self, centre: np.ndarray, a: np.ndarray, b: np.ndarray, texture: int, period_m: float,
        one_sided: bool = True,
    ) -> None:  # fmt: skip
        """Rectangle of half-edges a and b, seen from the side of a x b."""
        corners = np.stack([centre - a - b, centre + a - b, centre + a + b, centre - a + b])
        wide, high = 2 * np.linalg.norm(a) / period_m, 2 * np.linalg.norm(b) / period_m
        uv = np.array([[0, 0], [wide, 0], [wide, high], [0, high]]) + self.rng.uniform(0, 1, 2)
        self.builder.add(corners, uv, texture, one_sided)

    def _faces(self, centre: np.ndarray, half: np.ndarray, turn: np.ndarray, inward: bool,
               texture: int | None, period_m: float) -> None:  # fmt: skip
        axes = turn * half  # columns are the half-edges
        for i in range(3):
            n, a, b = (axes[:, (i + k) % 3] for k in range(3))
            for sign in (1.0, -1.0):
                own = self._texture() if texture is None else texture
                along = a * sign * (-1.0 if inward else 1.0)
                self.quad(centre + sign * n, along, b, own, period_m)

    def box(
        self, centre: np.ndarray, half: np.ndarray, turn: np.ndarray, texture: int | None = None
    ) -> None:
        """Box of half-sizes `half`; one texture for all faces mostly."""
        if texture is None:
            texture = self._texture()
        period = float(np.max(half) * np.exp(self.rng.uniform(np.log(0.4), np.log(4))))
        self._faces(centre, half, turn, False, texture, period)

    def sheet(self, centre: np.ndarray, half: np.ndarray, tilt: float) -> None:
        """A flat sheet that faces -x, tilted a little."""
        turn = rotation(self.rng, tilt)
        period = float(np.max(half) * np.exp(self.rng.uniform(np.log(0.15), np.log(1.5))))
        a, b = turn[:, 1] * half[0], turn[:, 2] * half[1]
        self.quad(centre, a, b, self._texture(), period, one_sided=False)

    def room(self, half: np.ndarray) -> None:
        """Floor, ceiling and walls; the floor lies at z = 0. Walls often share their paper."""
        shared = self._texture() if self.rng.random() < 0.6 else None
        period = float(np.exp(self.rng.uniform(np.log(0.4), np.log(3))))
        self._faces(np.array([0, 0, half[2]]), half, np.eye(3), True, shared, period)
        self.rug(np.zeros(3), np.eye(3), half[:2])

    def on_floor(self, place: np.ndarray, half: np.ndarray, turn: np.ndarray) -> None:
        """A box that stands on the floor at `place`."""
        self.box(place + np.array([0, 0, half[2]]), half, turn)

    def table(self, place: np.ndarray, turn: np.ndarray) -> None:
        """Four thin legs and a top: what a robot sees of tables, chairs and beds."""
        rng = self.rng
        top = np.array([rng.uniform(0.18, 0.7), rng.uniform(0.18, 0.45), 0.02])
        high, leg = rng.uniform(0.2, 0.8), rng.uniform(0.008, 0.035)
        texture = self._texture()
        for x in (-1, 1):
            for y in (-1, 1):
                corner = turn @ np.array([x * (top[0] - leg), y * (top[1] - leg), high / 2])
                self.box(place + corner, np.array([leg, leg, high / 2]), turn, texture)
        self.box(place + np.array([0, 0, high]), top, turn, texture)

    def rug(self, place: np.ndarray, turn: np.ndarray, half: np.ndarray | None = None) -> None:
        """A flat rectangle just above the floor (or the floor's own covering)."""
        rng = self.rng
        size = rng.uniform([0.3, 0.2], [1.2, 0.8]) if half is None else half
        lift = rng.uniform(0.003, 0.008) if half is None else 0.001
        period = float(np.exp(rng.uniform(np.log(0.25), np.log(2.5))))
        a, b = turn[:, 0] * size[0], turn[:, 1] * size[1]
        self.quad(place + np.array([0, 0, lift]), a, b, self._texture(), period)

    def lit_mesh(self) -> Mesh:
        """Everything so far as one mesh under random lamps."""
        mesh, samples, _ = self.builder.build()
        return replace(mesh, light=light(self.rng, samples))
