"""Sights without pictures: scan, landmarks, motion and marker drawn with perception's errors.

A run with rendered frames spends nine tenths of its time on pictures. Planning, mission and SLAM
can be judged in many more homes when each frame's result is drawn from the true world and the
errors that were measured on rendered frames: noise of disparity that neighbouring columns share,
missed columns near plain things, false ones, landmarks that shift with the side they are seen from.
"""

from __future__ import annotations

import math
from functools import lru_cache

import cv2
import numpy as np

from robot.config import Config
from robot.geometry.se2 import SE2
from robot.messages import Landmark, Marker, Scan, Seen, VisualMotion
from robot.sim.collide import march
from robot.sim.world import World

CELL_M = 0.01
FAN = 160  # rays, spread over the columns of the image
NEAREST_M = 0.12  # of the eye: nearer, nothing can be matched
SIGMA_PX, SIGMA_BIAS_PX = 0.25, 0.08  # of an obstacle's disparity: of a stretch, of a whole frame
STRETCH = 8  # neighbouring rays that share their error
MISSED_NEAR, MISSED_FAR, NEAR_M = 0.10, 0.03, 0.4  # stretches not seen, by distance
FALSE = 0.008  # stretches with something that is not there
LANDMARK_EVERY_M, LANDMARK_HEIGHT_M = 0.22, (0.06, 0.9)
LANDMARK_RANGE_M = (0.35, 4.0)
SIGMA_U_PX, SIGMA_D_PX = 0.35, 0.2
SIDE_SIGMA_M, SIDES = 0.012, 12  # a landmark from another side is not quite the same point
SEEN_AGE = 5  # frames until a point in sight is old enough
HOME_SEED = 77
FLIPPED_BITS = 12  # of a signature's 256, from look to look
MAX_LANDMARKS = 30
STEP_SIGMA_M, STEP_SIGMA_RAD = 0.003, 0.002
JUMP_M = 0.3  # farther between two frames nothing can be followed
MARKER_RANGE_M, MARKER_FACING_RAD = (0.15, 1.8), 1.0


class DrawnSight:
    """Perception's results for a robot in `world`. Deterministic for a seed."""

    def __init__(self, world: World, config: Config, seed: int) -> None:
        self._world, self._config = world, config
        self._camera = config.camera.stereo_camera()
        self._rng = np.random.default_rng([seed, 77])
        self.dark = False
        self.rebuild(world)
        half_u = (self._camera.width_px - 1) / 2.0
        column = np.linspace(half_u, -half_u, FAN)
        self._fan_rad = np.arctan2(column, self._camera.focal_px)
        self._bearings = np.linspace(
            self._fan_rad[-1], self._fan_rad[0], config.perception.scan_bearings
        )
        self._eye = SE2(config.camera.x_m, config.camera.y_m)
        home = np.random.default_rng(HOME_SEED)  # what there is to see is the same in every run
        self._landmarks_m, self._heights_m = self._scatter(home)
        self._bits = home.integers(0, 2, (len(self._heights_m), 256), dtype=np.uint8)
        self._age = np.zeros(len(self._heights_m), int)
        self._track = np.full(len(self._heights_m), -1)
        self._tracks = 0
        self._marker_track = -1
        self._before: SE2 | None = None

    def rebuild(self, world: World) -> None:
        """The world has changed; landmarks stay where they were, unless something hides them."""
        self._world = world
        occupied, self._x0, self._y0 = world.occupancy(CELL_M)
        far = cv2.distanceTransform((~occupied).astype(np.uint8), cv2.DIST_L2, 5)
        self._far_m = far * CELL_M

    def see(self, t_ns: int, arrived_ns: int, seq: int, world_from_base: SE2) -> Seen:
        """What one frame from this pose (scene coordinates) would have shown; nothing if `dark`."""
        if self.dark:
            unknown = np.full(len(self._bearings), np.nan)
            scan = Scan(self._bearings, unknown, np.zeros(len(self._bearings)))
            self._before, self._age = None, np.zeros_like(self._age)
            return Seen(t_ns, arrived_ns, seq, (), scan, 0.0)
        scan = self._scan(world_from_base)
        marker = self._marker(world_from_base)
        landmarks = self._points(world_from_base) + self._marker_landmark(marker)
        motion = self._motion(world_from_base)
        return Seen(t_ns, arrived_ns, seq, tuple(landmarks), scan, 0.8, motion, marker)

    # ------------------------------------------------------------------ scan

    def _cast(self, eye: SE2, angle_rad: np.ndarray) -> np.ndarray:
        """Distance (n,) from the eye to the first obstacle."""
        angle_rad = eye.yaw_rad + angle_rad
        return march(self._far_m, CELL_M, self._x0, self._y0, eye.x_m, eye.y_m, angle_rad)

    def _shared(self, sigma: float) -> np.ndarray:
        """Noise (FAN,) that neighbouring rays share."""
        knots = self._rng.normal(0.0, sigma, FAN // STRETCH + 2)
        return np.interp(np.arange(FAN) / STRETCH, np.arange(len(knots)), knots)

    def _scan(self, pose: SE2) -> Scan:
        fan = self._fan_rad
        reach_m = self._cast(pose @ self._eye, fan)
        fb = self._camera.focal_px * self._camera.baseline_m
        true_px = fb / np.maximum(reach_m * np.cos(fan), 1e-3)
        noise_px = self._shared(SIGMA_PX) + self._rng.normal(0.0, SIGMA_BIAS_PX)
        range_m = fb / np.maximum(true_px + noise_px, 1.0) / np.cos(fan)
        stretch = np.arange(FAN) // STRETCH
        dice = self._rng.random(stretch[-1] + 1)[stretch]
        missed = dice < np.where(reach_m < NEAR_M, MISSED_NEAR, MISSED_FAR)
        false = dice > 1.0 - FALSE
        range_m = np.where(false, self._rng.uniform(0.3, 1.5), range_m)
        most_m = self._config.perception.scan_range_m
        known = (range_m < most_m) & (range_m > NEAREST_M) & ~missed
        clear_m = np.where(missed, 0.0, np.minimum(range_m, most_m))
        return self._binned(range_m, known, clear_m)

    def _binned(self, range_m: np.ndarray, known: np.ndarray, clear_m: np.ndarray) -> Scan:
        """From rays of the eye to bearings in `base`."""
        fan, bearings = self._fan_rad, self._bearings
        nearest = np.full(len(bearings), np.inf)
        clear = np.full(len(bearings), np.inf)
        for reach_m, use, out in ((range_m, known, nearest), (clear_m, clear_m > 0.0, clear)):
            x = self._eye.x_m + reach_m * np.cos(fan)
            y = self._eye.y_m + reach_m * np.sin(fan)
            slot = np.rint((np.arctan2(y, x) - bearings[0]) / (bearings[1] - bearings[0]))
            use = use & (slot >= 0) & (slot < len(bearings))
            np.minimum.at(out, slot[use].astype(int), np.hypot(x, y)[use])
        clear = np.fmin(clear, nearest)
        clear[~np.isfinite(clear)] = 0.0
        return Scan(bearings, np.where(np.isfinite(nearest), nearest, np.nan), clear)

    # ------------------------------------------------------------------ landmarks

    def _scatter(self, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Places (n, 2) on the outlines of things, and heights (n,)."""
        places = []
        for x0, y0, x1, y1 in self._world.segments():
            count = rng.poisson(math.hypot(x1 - x0, y1 - y0) / LANDMARK_EVERY_M)
            t = rng.random(count)[:, None]
            places.append(np.array([[x0, y0]]) * (1.0 - t) + np.array([[x1, y1]]) * t)
        points = np.concatenate(places) if places else np.zeros((0, 2))
        return points, rng.uniform(*LANDMARK_HEIGHT_M, len(points))

    def _points(self, pose: SE2) -> list[Landmark]:
        eye = pose @ self._eye
        at = eye.inverse().apply(self._landmarks_m)
        away_m, angle = np.hypot(at[:, 0], at[:, 1]), np.arctan2(at[:, 1], at[:, 0])
        seen = (np.abs(angle) < self._fan_rad[0]) & (away_m < LANDMARK_RANGE_M[1])
        seen &= away_m > LANDMARK_RANGE_M[0]
        index = np.flatnonzero(seen)
        index = index[self._cast(eye, angle[index]) > away_m[index] - 0.03]
        age = np.zeros_like(self._age)
        age[index] = self._age[index] + 1
        new = index[age[index] == 1]
        self._track[new] = self._tracks + np.arange(len(new))
        self._tracks += len(new)
        self._age = age
        old = index[age[index] > SEEN_AGE]
        old = old[np.argsort(-age[old], kind="stable")][:MAX_LANDMARKS]
        return [self._landmark(int(i), at[i], float(eye.yaw_rad + angle[i])) for i in old]

    def _landmark(self, i: int, at_m: np.ndarray, from_rad: float) -> Landmark:
        """One sight of landmark `i`, which truly is at (2,) in the eye's frame."""
        side = int(from_rad / (2.0 * math.pi) * SIDES) % SIDES
        shift = _shift_m(i, side)
        z, across = np.maximum(at_m + shift, [0.1, -10.0])
        camera = self._camera
        sigma_z = z * z * SIGMA_D_PX / (camera.focal_px * camera.baseline_m)
        sigma_across = z * SIGMA_U_PX / camera.focal_px
        slope = across / z  # an error of depth moves a point along its ray
        noise_z = self._rng.normal(0.0, sigma_z)
        x = self._eye.x_m + z + noise_z
        y = self._eye.y_m + across + slope * noise_z + self._rng.normal(0.0, sigma_across)
        cov = sigma_z**2 * np.array([[1.0, slope], [slope, slope**2]])
        cov[1, 1] += sigma_across**2
        range_m = math.hypot(x, y)
        polar = np.array([[x, y], [-y / range_m, x / range_m]]) / range_m
        bits = self._bits[i].copy()
        bits[self._rng.integers(0, 256, FLIPPED_BITS)] ^= 1
        return Landmark(
            range_m,
            math.atan2(y, x),
            polar @ cov @ polar.T,
            np.packbits(bits).tobytes(),
            height_m=float(self._heights_m[i]),
            track_id=int(self._track[i]),
        )

    # ------------------------------------------------------------------ motion and marker

    def _motion(self, pose: SE2) -> VisualMotion | None:
        before, self._before = self._before, pose
        if before is None:
            return None
        step = before.inverse() @ pose
        if math.hypot(step.x_m, step.y_m) > JUMP_M:
            return None
        dx, dy, dyaw = self._rng.normal(0.0, 1.0, 3)
        step = SE2(
            step.x_m + dx * STEP_SIGMA_M,
            step.y_m + dy * STEP_SIGMA_M,
            step.yaw_rad + dyaw * STEP_SIGMA_RAD,
        )
        cov = np.diag([STEP_SIGMA_M**2, STEP_SIGMA_M**2, STEP_SIGMA_RAD**2])
        return VisualMotion(step, cov, 40)

    def _marker(self, pose: SE2) -> Marker | None:
        """The dock's marker, if it is near, turned this way and nothing hides it."""
        eye = pose @ self._eye
        at = eye.inverse() @ self._world.dock
        away_m, angle = math.hypot(at.x_m, at.y_m), math.atan2(at.y_m, at.x_m)
        facing = abs(math.remainder(at.yaw_rad + math.pi - angle, 2.0 * math.pi))
        hidden = self._cast(eye, np.array([angle]))[0] < away_m - 0.15  # its plate is before it
        inside = abs(angle) < 0.9 * self._fan_rad[0]
        near = MARKER_RANGE_M[0] < away_m < MARKER_RANGE_M[1]
        if hidden or not inside or not near or facing > MARKER_FACING_RAD:
            return None
        sigma_m, sigma_rad = 0.003 + 0.006 * away_m, 0.03 + 0.05 * away_m
        dx, dy, dyaw = self._rng.normal(0.0, 1.0, 3) * (sigma_m, sigma_m, sigma_rad)
        base = pose.inverse() @ self._world.dock
        seen = SE2(base.x_m + dx, base.y_m + dy, base.yaw_rad + dyaw)
        cov = np.diag([sigma_m**2, sigma_m**2, sigma_rad**2])
        return Marker(self._config.robot.dock_marker_id, seen, cov)

    def _marker_landmark(self, marker: Marker | None) -> list[Landmark]:
        if marker is None:
            self._marker_track = -1
            return []
        if self._marker_track < 0:
            self._marker_track, self._tracks = self._tracks, self._tracks + 1
        x, y = marker.base_from_marker.x_m, marker.base_from_marker.y_m
        range_m = math.hypot(x, y)
        polar = np.array([[x, y], [-y / range_m, x / range_m]]) / range_m
        return [
            Landmark(
                range_m,
                math.atan2(y, x),
                polar @ marker.cov[:2, :2] @ polar.T,
                marker.marker_id.to_bytes(32, "little"),
                kind="marker",
                track_id=self._marker_track,
            )
        ]


@lru_cache(maxsize=4096)
def _shift_m(i: int, side: int) -> np.ndarray:
    """How far (2,) landmark `i` lies from itself when it is seen from another side."""
    return np.random.default_rng([i, side]).normal(0.0, SIDE_SIGMA_M, 2)
