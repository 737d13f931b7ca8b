"""A flat as a bitmap, seen through a camera's scan and driven by an ideal follower: for tests."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from robot.config import MappingConfig, PlanningConfig, RobotConfig
from robot.geometry.se2 import SE2
from robot.mapping.grid import OccupancyGrid
from robot.mapping.swept import SweptFloor
from robot.messages import Planned, PlanOrder, Scan
from robot.planning.worker import plan

CELL_M = 0.01
FOV_RAD = math.radians(70.0)
BEAMS = 120
EYE_X_M = 0.13
BLIND_M = 0.21
FOCAL_BASELINE = 228.0 * 0.06


class FlatWorld:
    """Matter on a 1 cm raster; world origin at the raster's lower left corner plus `origin_m`."""

    def __init__(self, size_m: tuple[float, float]) -> None:
        self.matter = np.ones((round(size_m[1] / CELL_M), round(size_m[0] / CELL_M)), bool)

    def box(self, x0: float, y0: float, x1: float, y1: float, solid: bool = True) -> None:
        """Fill (or empty) an axis-aligned box, metres."""
        s = 1.0 / CELL_M
        self.matter[round(y0 * s) : round(y1 * s), round(x0 * s) : round(x1 * s)] = solid

    def legs(self, x: float, y: float, dx: float, dy: float, side: float = 0.04) -> None:
        """Four square legs at the corners of a box with its lower left corner at (x, y)."""
        for cx in (x, x + dx):
            for cy in (y, y + dy):
                self.box(cx - side / 2, cy - side / 2, cx + side / 2, cy + side / 2)

    def turned(self, angle_rad: float) -> FlatWorld:
        """The same flat turned about its middle."""
        high, wide = self.matter.shape
        c, s = abs(math.cos(angle_rad)), abs(math.sin(angle_rad))
        w, h = int(wide * c + high * s) + 2, int(wide * s + high * c) + 2
        warp = cv2.getRotationMatrix2D((wide / 2, high / 2), math.degrees(angle_rad), 1.0)
        warp[:, 2] += (w / 2 - wide / 2, h / 2 - high / 2)
        out = FlatWorld((1.0, 1.0))
        out.matter = (
            cv2.warpAffine(self.matter.astype(np.uint8), warp, (w, h), flags=0, borderValue=1) > 0
        )
        return out

    def clearance_m(self) -> np.ndarray:
        free = (~self.matter).astype(np.uint8)
        return (cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) - 0.5) * CELL_M

    def reachable(self, start: SE2, robot: RobotConfig) -> tuple[np.ndarray, np.ndarray]:
        """(centres, floor) connected to `start`."""
        centres = (self.clearance_m() >= robot.radius_m).astype(np.uint8)
        _, labels = cv2.connectedComponents(centres, connectivity=4)
        y, x = int(start.y_m / CELL_M), int(start.x_m / CELL_M)
        here = labels == labels[y, x]
        assert centres[y, x], "the start must be free"
        n = round(robot.brush_width_m / 2 / CELL_M)
        yy, xx = np.mgrid[-n : n + 1, -n : n + 1]
        brush = (xx**2 + yy**2 <= n * n).astype(np.uint8)
        return here, cv2.dilate(here.astype(np.uint8), brush).astype(bool)

    def scan(self, pose: SE2, rng: np.random.Generator, sigma_px: float = 0.3) -> Scan:
        """What stereo at 9 cm height would report: noisy ranges, floor seen free up to matter."""
        angle = np.linspace(-FOV_RAD / 2, FOV_RAD / 2, BEAMS)
        r = np.arange(0.02, 4.0, 0.008)
        c, s = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
        ex, ey = pose.x_m + c * EYE_X_M, pose.y_m + s * EYE_X_M
        x = ex + np.cos(pose.yaw_rad + angle)[:, None] * r
        y = ey + np.sin(pose.yaw_rad + angle)[:, None] * r
        ix = np.clip((x / CELL_M).astype(int), 0, self.matter.shape[1] - 1)
        iy = np.clip((y / CELL_M).astype(int), 0, self.matter.shape[0] - 1)
        hits = self.matter[iy, ix]
        first = hits.argmax(axis=1)
        depth = np.where(hits.any(axis=1), r[first], np.nan)
        z = depth * np.cos(angle)
        z_seen = z + rng.normal(0.0, 1.0, BEAMS) * z**2 * sigma_px / FOCAL_BASELINE
        seen = np.where(z_seen > BLIND_M, z_seen / np.cos(angle), np.nan)
        seen[(seen > 3.5)] = np.nan
        clear = np.where(np.isfinite(depth), np.minimum(depth, 2.0), 2.0)
        clear = np.where(depth < BLIND_M, 0.0, clear)
        bx, by = EYE_X_M + seen * np.cos(angle), seen * np.sin(angle)
        qx, qy = EYE_X_M + clear * np.cos(angle), clear * np.sin(angle)
        bearing = np.where(np.isfinite(seen), np.arctan2(by, bx), np.arctan2(qy, qx))
        order = np.argsort(bearing, kind="stable")
        return Scan(
            bearing[order],
            np.hypot(bx, by)[order],
            np.where(clear > 0, np.hypot(qx, qy), 0.0)[order],
        )


def three_rooms() -> tuple[FlatWorld, SE2]:
    """About 18 m2 of reachable floor in three furnished rooms, and the docked pose."""
    w = FlatWorld((6.4, 5.0))
    w.box(0.1, 0.1, 3.3, 2.9, False)  # living room
    w.box(3.4, 0.1, 6.3, 2.4, False)  # kitchen
    w.box(0.1, 3.0, 6.3, 4.9, False)  # bedroom and hall
    w.box(3.3, 0.9, 3.4, 1.7, False)  # doors
    w.box(1.2, 2.9, 2.0, 3.0, False)
    w.box(3.4, 2.4, 6.3, 3.0, True)
    w.box(4.4, 2.3, 5.2, 3.0, False)
    w.box(0.1, 0.9, 0.9, 2.6)  # sofa
    w.legs(1.7, 1.2, 0.7, 0.5)  # table
    w.legs(2.05, 0.55, 0.4, 0.4, 0.035)  # chair
    w.box(3.4, 0.1, 5.4, 0.6)  # kitchen line
    w.legs(5.3, 1.3, 0.6, 0.6)
    w.box(4.3, 3.6, 6.3, 4.9)  # bed on the floor
    w.box(0.1, 4.5, 1.4, 4.9)  # wardrobe
    w.box(2.6, 4.3, 2.9, 4.6)  # box in the open
    return w, SE2(0.32, 0.5, math.pi)


@dataclass
class Run:
    """What a drive through the flat gave."""

    track: np.ndarray  # (n, 4): t_s, x, y, yaw
    plans: list[Planned]
    plan_s: list[float]
    covered_share: float
    reachable_m2: float
    path_m: float
    duration_s: float
    collisions: int
    grid: OccupancyGrid
    swept: SweptFloor
    finished: bool


class Cleaner:
    """The loop map -> plan -> drive with a perfect pose, 20 Hz kinematics, scans at 10 Hz."""

    def __init__(
        self,
        world: FlatWorld,
        start: SE2,
        seed: int = 0,
        mapping: MappingConfig | None = None,
        planning: PlanningConfig | None = None,
        robot: RobotConfig | None = None,
    ) -> None:
        self.world, self.pose = world, start
        self.mapping, self.planning = mapping or MappingConfig(), planning or PlanningConfig()
        self.robot = robot or RobotConfig()
        self.rng = np.random.default_rng(seed)
        self.grid = OccupancyGrid(self.mapping)
        self.swept = SweptFloor(self.mapping, self.robot.brush_width_m)
        self.room = world.clearance_m()
        self.start = start
        self.t_s, self.tick = 0.0, 0
        self.track: list[tuple[float, float, float, float]] = []
        self.collisions = 0
        self.blocked = False

    def step(self, v: float, w: float, dt: float = 0.05) -> None:
        yaw = self.pose.yaw_rad + w * dt
        x = self.pose.x_m + v * dt * math.cos(self.pose.yaw_rad + w * dt / 2)
        y = self.pose.y_m + v * dt * math.sin(self.pose.yaw_rad + w * dt / 2)
        self.blocked = False
        if self.room[int(y / CELL_M), int(x / CELL_M)] < self.robot.radius_m - 0.006:
            self.collisions += 1
            self.blocked = True
            x, y = self.pose.x_m, self.pose.y_m
        self.pose = SE2(x, y, (yaw + math.pi) % (2 * math.pi) - math.pi)
        self.t_s += dt
        self.tick += 1
        self.track.append((self.t_s, x, y, self.pose.yaw_rad))
        self.swept.sweep(self.pose)
        if self.tick % 2 == 0:
            self.grid.clear_footprint(self.pose, self.robot.radius_m)
            self.grid.integrate(self.pose, self.world.scan(self.pose, self.rng))

    def turn_to(self, yaw: float) -> None:
        for _ in range(400):
            error = (yaw - self.pose.yaw_rad + math.pi) % (2 * math.pi) - math.pi
            if abs(error) < 0.02:
                return
            self.step(0.0, max(-1.2, min(1.2, error / 0.05)))

    def bump(self) -> None:
        """Remember what was touched and back off."""
        c, s = math.cos(self.pose.yaw_rad), math.sin(self.pose.yaw_rad)
        r = self.robot.radius_m + 0.01
        self.grid.mark_obstacle(np.array([[self.pose.x_m + c * r, self.pose.y_m + s * r]]))
        for _ in range(6):
            self.step(-0.15, 0.0)

    def follow(self, points: np.ndarray, until_s: float) -> bool:
        """Drive along the waypoints; False when time is up or something was touched."""
        for p in points:
            for _ in range(4000):
                if self.t_s >= until_s:
                    return False
                dx, dy = p[0] - self.pose.x_m, p[1] - self.pose.y_m
                far = math.hypot(dx, dy)
                if far < 0.012:
                    break
                error = (math.atan2(dy, dx) - self.pose.yaw_rad + math.pi) % (2 * math.pi) - math.pi
                if abs(error) > 0.35 and far > 0.02:
                    self.turn_to(math.atan2(dy, dx))
                    continue
                v = min(self.robot.cruise_mps, far / 0.05)
                self.step(v, max(-1.2, min(1.2, error / 0.1)))
                if self.blocked:
                    self.bump()
                    return False
        return True

    def order(self, kind: str = "coverage", goal: SE2 | None = None) -> PlanOrder:
        snapshot = self.grid.snapshot()
        return PlanOrder(
            round(self.t_s * 1e9),
            len(self.track),
            kind,
            snapshot,
            self.swept.on(snapshot),
            self.pose,
            goal,
        )

    def clean(self, limit_s: float = 1500.0, replan_s: float = 15.0, clock=None) -> Run:
        """Back off, look around, and clean until the planner has nothing left."""
        plans, plan_s, finished = [], [], False
        for _ in range(36):
            self.step(-0.25, 0.0)
        self.turn_to(self.pose.yaw_rad + 2.0)
        self.turn_to(self.pose.yaw_rad + 2.0)
        self.turn_to(self.pose.yaw_rad + 2.28)
        while self.t_s < limit_s:
            order = self.order()
            began = clock() if clock else 0.0
            answer = plan(order, self.planning, self.robot)
            plan_s.append((clock() if clock else 0.0) - began)
            plans.append(answer)
            if len(answer.path.points_m) == 0:
                finished = True
                break
            self.follow(answer.path.points_m[1:], self.t_s + replan_s)
        track = np.array(self.track)
        _centres, floor = self.world.reachable(self.pose, self.robot)
        covered = swept_truth(track, floor.shape, self.robot.brush_width_m)
        return Run(
            track,
            plans,
            plan_s,
            float((covered & floor).sum() / floor.sum()),
            float(floor.sum()) * CELL_M**2,
            float(np.hypot(*np.diff(track[:, 1:3], axis=0).T).sum()),
            self.t_s,
            self.collisions,
            self.grid,
            self.swept,
            finished,
        )


def swept_truth(track: np.ndarray, shape: tuple[int, int], brush_m: float) -> np.ndarray:
    """Cells of the 1 cm raster swept by the bar, drawn step by step."""
    mask = np.zeros(shape, np.uint8)
    half = brush_m / 2 - CELL_M / 2
    nx, ny = -np.sin(track[:, 3]) * half, np.cos(track[:, 3]) * half
    left = np.stack([track[:, 1] + nx, track[:, 2] + ny], 1)
    right = np.stack([track[:, 1] - nx, track[:, 2] - ny], 1)
    for i in range(1, len(track)):
        quad = np.array([left[i - 1], right[i - 1], right[i], left[i]]) / CELL_M - 0.5
        hull = cv2.convexHull(np.rint(quad * 16).astype(np.int32))
        cv2.fillConvexPoly(mask, hull, 1, cv2.LINE_8, 4)
    return mask > 0


def picture(run: Run, world: FlatWorld, path: str, plan_index: int | None = None) -> None:
    """Draw matter, reachable floor that was missed, and the track, as a PNG."""
    _, floor = world.reachable(SE2(*run.track[-1, 1:]), RobotConfig())
    covered = swept_truth(run.track, floor.shape, 0.2)
    image = np.full((*world.matter.shape, 3), 255, np.uint8)
    image[covered & floor] = (220, 245, 220)
    image[floor & ~covered] = (80, 80, 255)
    image[world.matter] = (60, 60, 60)
    image = cv2.resize(image, None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST)
    points = np.rint(run.track[:, 1:3] / CELL_M * 2).astype(np.int32)
    n = len(points)
    for i in range(1, n):
        t = i / n
        colour = (int(255 * (1 - t)), 80, int(255 * t))
        cv2.line(
            image, tuple(points[i - 1].tolist()), tuple(points[i].tolist()), colour, 1, cv2.LINE_AA
        )
    cv2.imwrite(path, image[::-1])
