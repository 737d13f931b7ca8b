"""Furnished rooms seen from the floor, and boxes floating in space, on the simulator's rasteriser.

Every scene gives a few pairs from different places. Half of the room pairs have the robot's own
eyes (9 cm above the floor, 228 px, 6 cm); the others vary height, focal length and baseline so
that the nearest things lie anywhere between 6 and 62 px.
"""

from __future__ import annotations

import numpy as np

from models.data.solids import Solids, rotation, unit_yaw
from robot.sim.renderer import Renderer, TextureAtlas

WIDTH, HEIGHT = 320, 240
ROBOT_FOCAL_PX, ROBOT_BASELINE_M, ROBOT_HEIGHT_M = 228.0, 0.06, 0.09
VIEWS, NEAREST_M = 4, 0.10
Pair = tuple[np.ndarray, np.ndarray, np.ndarray]


def look(position_m: np.ndarray, yaw: float, pitch_down: float, roll: float) -> np.ndarray:
    """`world_from_cam` (4, 4), camera x right, y down, z forward; world z up."""
    c, s = np.cos(pitch_down), np.sin(pitch_down)
    forward = np.array([np.cos(yaw) * c, np.sin(yaw) * c, -s])
    right = np.array([np.sin(yaw), -np.cos(yaw), 0.0])
    down = np.cross(forward, right)
    a, b = np.cos(roll), np.sin(roll)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([a * right + b * down, a * down - b * right, forward], 1)
    pose[:3, 3] = position_m
    return pose


def furnish(rng: np.random.Generator, solids: Solids) -> tuple[float, float]:
    """A room with furniture, centred on the origin; returns its half length and half width."""
    half = np.array([rng.uniform(1.2, 3.8), rng.uniform(1.2, 3.8), rng.uniform(1.15, 1.4)])
    solids.room(half)
    for _ in range(int(rng.integers(5, 21))):
        place = np.append(rng.uniform(-0.95, 0.95, 2) * half[:2], 0.0)
        turn = unit_yaw(float(rng.choice([0.0, np.pi / 2, rng.uniform(0, np.pi)])))
        kind = rng.random()
        if kind < 0.3:
            solids.on_floor(place, rng.uniform([0.05, 0.05, 0.04], [0.6, 0.35, 0.9]), turn)
        elif kind < 0.55:
            solids.table(place, turn)
        elif kind < 0.65:
            solids.on_floor(place, np.array([0.012, 0.012, rng.uniform(0.3, 1.0)]), turn)
        elif kind < 0.8:
            solids.rug(place, turn)
        else:
            solids.on_floor(place, rng.uniform([0.03, 0.03, 0.02], [0.2, 0.15, 0.2]), turn)
    return float(half[0]), float(half[1])


def float_things(rng: np.random.Generator, solids: Solids) -> None:
    """A far wall, perhaps a floor, and boxes and sheets at any angle, seen along +x from 0."""
    far = rng.uniform(3, 12)
    solids.sheet(np.array([far, 0, 0]), np.array([2.5 * far, 2.5 * far]), tilt=0.25)
    if rng.random() < 0.5:
        ground = np.array([far / 2, 0, -rng.uniform(0.1, 1.5)])
        solids.box(ground, np.array([2 * far, 2 * far, 0.01]), rotation(rng, 0.05))
    for _ in range(int(rng.integers(5, 18))):
        z = np.exp(rng.uniform(np.log(0.4), np.log(far)))
        at = np.array([z, rng.uniform(-0.8, 0.8) * z, rng.uniform(-0.55, 0.55) * z])
        size = z * rng.uniform(0.04, 0.4, 3)
        if rng.random() < 0.25:
            size = z * np.array([0.012, 0.012, rng.uniform(0.2, 0.8)])
        solids.box(at, size, rotation(rng, 1.0))


class RoomRenderer:
    """Renders pairs of random scenes with the textures of a bank (n, 512, 512)."""

    def __init__(self, bank: np.ndarray) -> None:
        self.atlas = TextureAtlas.pack(list(bank))
        self.count = len(bank)

    def pairs(self, rng: np.random.Generator) -> list[Pair]:
        """Up to four clean pairs of one new scene, as `shapes_pair` gives them."""
        solids = Solids(rng, self.count)
        indoors = rng.random() < 0.6
        if indoors:
            long, wide = furnish(rng, solids)
        else:
            float_things(rng, solids)
        renderer = Renderer(solids.lit_mesh(), self.atlas, WIDTH, HEIGHT)
        found = []
        for _ in range(VIEWS if indoors else 2):
            if indoors:
                place = rng.uniform(-0.85, 0.85, 2) * (long, wide)
                made = self._from_floor(rng, renderer, place, rng.random() < 0.5)
            else:
                origin = rng.normal(0, 0.05, 3)
                pose = look(origin, rng.normal(0, 0.15), rng.normal(0, 0.1), rng.normal(0, 0.1))
                made = self._expose(rng, renderer, pose, False)
            if made is not None:
                found.append(made)
        return found

    def robot_pairs(self, rng: np.random.Generator) -> list[Pair]:
        """Up to four clean pairs of one new room through the robot's own eyes."""
        solids = Solids(rng, self.count)
        half = furnish(rng, solids)
        renderer = Renderer(solids.lit_mesh(), self.atlas, WIDTH, HEIGHT)
        places = [rng.uniform(-0.85, 0.85, 2) * half for _ in range(VIEWS)]
        made = [self._from_floor(rng, renderer, place, True) for place in places]
        return [pair for pair in made if pair is not None]

    def _from_floor(
        self, rng: np.random.Generator, renderer: Renderer, place: np.ndarray, robot: bool
    ) -> Pair | None:
        low = rng.uniform(0.05, 0.2) if rng.random() < 0.6 else rng.uniform(0.2, 1.6)
        height = ROBOT_HEIGHT_M if robot else low
        yaw = np.arctan2(-place[1], -place[0]) + rng.normal(0, 1.0)
        pitch = rng.normal(0, 0.03) if robot else rng.normal(0.1, 0.2)
        pose = look(np.append(place, height), yaw, pitch, rng.normal(0, 0.01 if robot else 0.04))
        return self._expose(rng, renderer, pose, robot)

    def _expose(
        self, rng: np.random.Generator, renderer: Renderer, pose: np.ndarray, robot: bool
    ) -> Pair | None:
        """Both pictures and the disparity; None if something touches the lens or sky shows."""
        focal = ROBOT_FOCAL_PX if robot else ROBOT_FOCAL_PX * np.exp(rng.uniform(-0.4, 0.7))
        centre = (WIDTH - 1) / 2, (HEIGHT - 1) / 2
        left, inverse_depth = renderer.render(pose, focal, *centre)
        nearest = np.percentile(inverse_depth, 99)
        if nearest > 1 / NEAREST_M or (inverse_depth <= 0).mean() > 0.02:
            return None
        baseline = ROBOT_BASELINE_M
        if not robot:
            baseline = np.exp(rng.uniform(np.log(6), np.log(62))) / (nearest * focal)
        other = pose.copy()
        other[:3, 3] += baseline * pose[:3, 0]
        right, _ = renderer.render(other, focal, *centre)
        disparity = np.where(inverse_depth > 0, focal * baseline * inverse_depth, np.nan)
        grey = np.median(left) + 1e-3
        gain = rng.uniform(60, 160) / max(grey, 20)
        return left * np.float32(gain), right * np.float32(gain), disparity.astype(np.float32)
