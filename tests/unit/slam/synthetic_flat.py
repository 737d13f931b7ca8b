"""A flat made of points on walls, driven through and seen by a noisy stereo eye: test data.

Two-dimensional: a point has a place, a height and a 256-bit signature. The eye sees 70 degrees and
0.3 to 4 m, not through walls; depth errs in disparity, partly the same way for a whole track, and
a few observations are plainly wrong.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robot.geometry.se2 import SE2, wrap_angle
from robot.messages import ImuSample, Landmark, Marker, Scan, Seen, VisualMotion, WheelTravel

TICK_S = 0.02
TRACK_WIDTH_M = 0.23
FOCAL_BASELINE = 228.0 * 0.06
NO_SCAN = Scan(np.zeros(0), np.zeros(0), np.zeros(0))
DOCK = SE2(0.35, 0.0, math.pi)  # the marker, facing the docked robot

WALLS = np.array(  # x0, y0, x1, y1: three rooms of together 17 m^2, two doors
    [
        (0.5, -2.5, 0.5, 2.0),
        (-5.5, -2.5, 0.5, -2.5),
        (-5.5, 2.0, 0.5, 2.0),
        (-5.5, -2.5, -5.5, 2.0),
        (-2.2, -2.5, -2.2, -1.2),
        (-2.2, -0.4, -2.2, 2.0),
        (-5.5, -0.2, -4.2, -0.2),
        (-3.4, -0.2, -2.2, -0.2),
    ]
)


@dataclass(frozen=True)
class Faults:
    """How imperfect the robot is."""

    slip: bool = True
    gyro_bias_radps: float = 0.01
    gyro_noise_radps: float = 0.003
    wheel_scale: float = 0.01
    wheel_noise: float = 0.0005
    outliers: float = 0.03
    disparity_sigma_px: float = 0.3
    disparity_track_sigma_px: float = 0.15
    u_sigma_px: float = 0.7


@dataclass(frozen=True)
class Drive:
    """What happened, in order of arrival, and the truth (n, 3) at the frames' times."""

    events: list
    truth_t_ns: np.ndarray
    truth: np.ndarray


def sweep_path(lanes: int = 100) -> np.ndarray:
    """Waypoints (n, 2): out of the dock, then lanes through the three rooms and home again."""
    points = [(0.0, 0.0), (-0.5, 0.0)]
    rooms = [(-1.9, 0.2, -2.2, 1.7), (-5.2, -2.5, -2.2, -0.5), (-5.2, -2.5, 0.1, 1.7)]
    doors = [[(-1.8, -0.8), (-2.6, -0.8)], [(-3.8, -0.6), (-3.8, 0.3)], []]
    for (x0, x1, y0, y1), door in zip(rooms, doors, strict=True):
        ys = np.arange(y0, y1 + 0.01, 0.2)[:lanes]
        for i, y in enumerate(ys):
            points += [(x0, y), (x1, y)] if i % 2 else [(x1, y), (x0, y)]
        points += door
    points += [(-3.8, 0.3), (-3.8, -0.6), (-2.6, -0.8), (-1.8, -0.8), (-0.6, 0.0)]
    return np.array(points)


def drive_poses(path: np.ndarray, limit_s: float) -> np.ndarray:
    """True poses (n, 3) every tick: 1.5 s docked, back out, then straight lanes and turns."""
    poses = [(0.0, 0.0, 0.0)] * 75
    x, y, yaw = 0.0, 0.0, 0.0
    speed = turn = 0.0
    for index, (tx, ty) in enumerate(path[1:]):
        backwards = index == 0
        while math.hypot(tx - x, ty - y) > 0.02 and len(poses) * TICK_S < limit_s:
            error = wrap_angle(math.atan2(ty - y, tx - x) + (math.pi if backwards else 0.0) - yaw)
            far = math.hypot(tx - x, ty - y)
            wanted = 0.0 if abs(error) > 0.25 else min(0.25, 0.04 + far) * (-1 if backwards else 1)
            speed += float(np.clip(wanted - speed, -0.02, 0.02))
            turn += float(np.clip(np.clip(3.0 * error, -1.2, 1.2) - turn, -0.1, 0.1))
            yaw = wrap_angle(yaw + turn * TICK_S)
            x += speed * TICK_S * math.cos(yaw)
            y += speed * TICK_S * math.sin(yaw)
            poses.append((x, y, yaw))
    return np.array(poses)


def scatter_points(rng: np.random.Generator, per_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Places (n, 2) on the walls, a little in front of them, and heights (n,)."""
    places = []
    for x0, y0, x1, y1 in WALLS:
        n = int(per_m * math.hypot(x1 - x0, y1 - y0))
        part = rng.uniform(0, 1, n)[:, None]
        inward = rng.uniform(-0.25, 0.25, (n, 2)) * (rng.uniform(0, 1, n) < 0.5)[:, None]
        places.append(np.array([x0, y0]) + part * np.array([x1 - x0, y1 - y0]) + inward)
    place = np.concatenate(places)
    return place, rng.uniform(0.05, 1.5, len(place))


def _blocked(eye: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Whether a wall crosses the line from `eye` (2,) to each point (n, 2)."""
    a, b = WALLS[:, :2], WALLS[:, 2:]
    line, wall = points - eye, b - a
    cross = line[:, None, 0] * wall[None, :, 1] - line[:, None, 1] * wall[None, :, 0]
    cross = np.where(np.abs(cross) < 1e-9, 1e-9, cross)
    offset = a - eye
    along = (offset[:, 0] * wall[:, 1] - offset[:, 1] * wall[:, 0])[None] / cross
    part = (offset[None, :, 0] * line[:, None, 1] - offset[None, :, 1] * line[:, None, 0]) / cross
    return ((along > 0) & (along < 0.93) & (part > 0) & (part < 1)).any(axis=1)


def wheel_travel(poses: np.ndarray, rng: np.random.Generator, faults: Faults) -> np.ndarray:
    """Cumulative encoder travel (n, 2), with scale error, noise and slips every 20 s or so."""
    step = np.diff(poses[:, :2], axis=0)
    turn = (np.diff(poses[:, 2]) + math.pi) % (2 * math.pi) - math.pi
    middle = poses[:-1, 2] + 0.5 * turn
    ahead = step[:, 0] * np.cos(middle) + step[:, 1] * np.sin(middle)
    wheels = np.stack([ahead - turn * TRACK_WIDTH_M / 2, ahead + turn * TRACK_WIDTH_M / 2], axis=1)
    wheels *= 1.0 + rng.uniform(-faults.wheel_scale, faults.wheel_scale, 2)
    wheels += rng.normal(0, 1, wheels.shape) * faults.wheel_noise * np.sqrt(np.abs(wheels))
    k = 400
    while faults.slip and k < len(wheels) - 50:
        sides = [(0,), (1,), (0, 1), (0, 1)][rng.integers(4)]
        length = int(rng.integers(15, 40))
        for side in sides:
            wheels[k : k + length, side] *= rng.uniform(1.3, 2.0)
        k += length + 200 + int(rng.exponential(800))
    total = np.concatenate([np.zeros((1, 2)), np.cumsum(wheels, axis=0)])
    return np.round(total / 0.0003) * 0.0003


class Eye:
    """Keeps tracks alive while their points are seen."""

    def __init__(
        self, rng: np.random.Generator, faults: Faults, per_m: float, home: int | None
    ) -> None:
        self.rng, self.faults = rng, faults
        home_rng = rng if home is None else np.random.default_rng(home)
        self.place, self.height = scatter_points(home_rng, per_m)
        self.bits = home_rng.integers(0, 2, (len(self.place), 256)).astype(bool)
        self.track = np.full(len(self.place), -1)
        self.bias = np.zeros(len(self.place))
        self.next_track = 0

    def look(self, pose: np.ndarray) -> tuple[Landmark, ...]:
        """At most 36 points in sight of the camera, in `base`."""
        rng, faults = self.rng, self.faults
        c, s = math.cos(pose[2]), math.sin(pose[2])
        eye = np.array([pose[0] + 0.13 * c - 0.03 * s, pose[1] + 0.13 * s + 0.03 * c])
        offset = self.place - eye
        z, left = offset @ (c, s), offset @ (-s, c)
        far = np.hypot(z, left)
        sight = (z > 0.3) & (far < 4.0) & (np.abs(left) < math.tan(math.radians(35.0)) * z)
        sight &= self.height < 0.09 + 0.5 * z
        near = np.flatnonzero(sight)
        near = near[~_blocked(eye, self.place[near])]
        lost = self.track >= 0
        lost[near] = rng.uniform(0, 1, len(near)) < 0.03
        self.track[lost] = -1
        kept = near[self.track[near] >= 0]
        fresh = rng.permutation(near[self.track[near] < 0])[: max(36 - len(kept), 0)]
        self.track[fresh] = self.next_track + np.arange(len(fresh))
        self.next_track += len(fresh)
        self.bias[fresh] = rng.normal(0, faults.disparity_track_sigma_px, len(fresh))
        return tuple(self._observe(i, z[i], left[i]) for i in np.concatenate([kept, fresh])[:36])

    def _observe(self, i: int, z: float, left: float) -> Landmark:
        rng, faults = self.rng, self.faults
        d = FOCAL_BASELINE / z + self.bias[i] + rng.normal(0, faults.disparity_sigma_px)
        if rng.uniform() < faults.outliers:
            d += rng.choice([-1, 1]) * rng.uniform(1, 4)
        d = max(d, 2.5)
        u = -left / z * 228.0 + rng.normal(0, faults.u_sigma_px)
        z = FOCAL_BASELINE / d
        x, y = z + 0.13, 0.03 - u * z / 228.0
        r2 = x * x + y * y
        r = math.sqrt(r2)
        # (range, bearing) by (disparity, u)
        by_d, by_u = np.array([-z / d, u * z / 228.0 / d]), np.array([0.0, -z / 228.0])
        polar = np.array([[x / r, y / r], [-y / r2, x / r2]])
        jacobian = polar @ np.stack([by_d, by_u], axis=1)
        sigma_d = math.hypot(faults.disparity_sigma_px, faults.disparity_track_sigma_px)
        noise = np.diag([sigma_d**2, faults.u_sigma_px**2])
        bits = self.bits[i] ^ (rng.uniform(0, 1, 256) < rng.uniform(0.02, 0.12))
        return Landmark(
            r,
            math.atan2(y, x),
            jacobian @ noise @ jacobian.T,
            np.packbits(bits).tobytes(),
            "point",
            float(self.height[i] + rng.normal(0, 0.02)),
            int(self.track[i]),
        )


def see_marker(pose: np.ndarray, rng: np.random.Generator) -> Marker | None:
    """The dock's marker within 1.5 m and 35 degrees, its face turned to the eye."""
    seen = SE2(*pose.tolist()).inverse() @ DOCK
    ahead, side = seen.x_m - 0.13, seen.y_m - 0.03
    if not 0.1 < ahead < 1.5 or abs(side) > 0.6 * ahead or abs(wrap_angle(seen.yaw_rad)) < 2.0:
        return None
    sigma = np.array([0.003 + 0.01 * ahead**2, 0.002 + 0.002 * ahead, 0.03])
    error = rng.normal(0, 1, 3) * sigma
    noisy = SE2(seen.x_m + error[0], seen.y_m + error[1], seen.yaw_rad + error[2])
    return Marker(7, noisy, np.diag(sigma**2))


def drive(
    seed: int,
    limit_s: float = 600.0,
    faults: Faults | None = None,
    path: np.ndarray | None = None,
    per_m: float = 28.0,
    with_motion: bool = True,
    home: int | None = None,
) -> Drive:
    """Drive through the flat; the same seed gives the same drive. Frames arrive 60 ms late.

    What there is to see follows from `home`, if given, so that two drives can share it.
    """
    faults = Faults() if faults is None else faults
    rng = np.random.default_rng(seed)
    poses = drive_poses(sweep_path() if path is None else path, limit_s)
    wheels = wheel_travel(poses, rng, faults)
    bias = rng.uniform(-1, 1) * faults.gyro_bias_radps
    eye = Eye(rng, faults, per_m, home)
    rate = np.diff(poses[:, 2], prepend=0.0)
    rate = ((rate + math.pi) % (2 * math.pi) - math.pi) / TICK_S
    rate += bias + rng.normal(0, faults.gyro_noise_radps, len(rate))
    events, frames, waiting, last = [], [], None, poses[0]
    for k, pose in enumerate(poses):
        t_ns = k * 20_000_000
        events.append(ImuSample(t_ns, float(rate[k])))
        events.append(WheelTravel(t_ns, t_ns, float(wheels[k, 0]), float(wheels[k, 1])))
        if waiting is not None and t_ns >= waiting.arrived_ns:
            events.append(waiting)
            waiting = None
        if k % 5 == 0:
            motion = _motion(last, pose, rng) if with_motion and k else None
            marker = see_marker(pose, rng)
            waiting = Seen(
                t_ns, t_ns + 60_000_000, k // 5, eye.look(pose), NO_SCAN, 0.8, motion, marker
            )
            frames.append(k)
            last = pose
    return Drive(events, np.array(frames) * 20_000_000, poses[frames])


def _motion(last: np.ndarray, pose: np.ndarray, rng: np.random.Generator) -> VisualMotion:
    true = SE2(*last.tolist()).inverse() @ SE2(*pose.tolist())
    sigma = np.array([0.005, 0.004, 0.002])
    error = rng.normal(0, 1, 3) * sigma
    seen = SE2(true.x_m + error[0], true.y_m + error[1], true.yaw_rad + error[2])
    return VisualMotion(seen, np.diag(sigma**2), 40)


def aligned_rmse_m(estimate: np.ndarray, truth: np.ndarray) -> float:
    """Position error (RMSE) of (n, 2) tracks after rigid alignment (Umeyama 1991, no scale)."""
    a, b = estimate[:, :2] - estimate[:, :2].mean(0), truth[:, :2] - truth[:, :2].mean(0)
    u, _, vt = np.linalg.svd(a.T @ b)
    rotation = u @ np.diag([1.0, np.linalg.det(u @ vt)]) @ vt
    return float(np.sqrt(((a @ rotation - b) ** 2).sum(axis=1).mean()))
