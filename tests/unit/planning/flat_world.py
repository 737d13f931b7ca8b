"""A flat as a bitmap, seen through a camera's scan and driven by an ideal follower: for tests."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from robot.config import MappingConfig, PlanningConfig, RobotConfig
from robot.geometry.se2 import SE2
from robot.mapping.grid import OccupancyGrid
from robot.mapping.swept import SweptFloor
from robot.messages import Path, Planned, PlanOrder, Scan
from robot.planning.worker import plan

CELL_M = 0.01
FOV_RAD = math.radians(70.0)
BEAMS = 120
EYE_X_M, EYE_Y_M = 0.13, 0.03
BLIND_M = 0.21
DT_S = 0.02
GRAZE_M, NEAR_MPS = 0.015, 0.14
SHARP_RAD = 0.6
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
        eye = pose @ SE2(EYE_X_M, EYE_Y_M)
        x = eye.x_m + np.cos(pose.yaw_rad + angle)[:, None] * r
        y = eye.y_m + np.sin(pose.yaw_rad + angle)[:, None] * r
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
        bx, by = EYE_X_M + seen * np.cos(angle), EYE_Y_M + seen * np.sin(angle)
        qx, qy = EYE_X_M + clear * np.cos(angle), EYE_Y_M + clear * np.sin(angle)
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
    """The loop map -> plan -> drive with a perfect pose, 50 Hz kinematics, scans at 10 Hz."""

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
        self.replan_s = math.inf
        self.plan_index: list[int] = []  # of the track, where each plan came
        self.bumps: list[tuple[float, float, float, float, float]] = []

    def step(self, v: float, w: float, dt: float = DT_S) -> None:
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
        if self.tick % 5 == 0:
            self.grid.clear_footprint(self.pose, self.robot.radius_m)
            self.grid.integrate(self.pose, self.world.scan(self.pose, self.rng))

    def turn_to(self, yaw: float) -> None:
        for _ in range(1000):
            error = (yaw - self.pose.yaw_rad + math.pi) % (2 * math.pi) - math.pi
            if abs(error) < 0.02:
                return
            self.step(0.0, max(-1.2, min(1.2, error / 0.1)))

    def bump(self) -> None:
        """Remember which half of the bumper was touched, as a robot would, and back off."""
        x, y = self.pose.x_m, self.pose.y_m
        iy, ix = np.nonzero(self.world.matter)
        near = np.argmin((ix * CELL_M - x) ** 2 + (iy * CELL_M - y) ** 2)
        bearing = math.atan2(iy[near] * CELL_M - y, ix[near] * CELL_M - x) - self.pose.yaw_rad
        bearing = (bearing + math.pi) % (2 * math.pi) - math.pi
        side = 0.0 if abs(bearing) < 0.35 else math.copysign(0.8, bearing)
        self.bumps.append((self.t_s, x, y, self.pose.yaw_rad, bearing))
        c, s = math.cos(self.pose.yaw_rad + side), math.sin(self.pose.yaw_rad + side)
        r = self.robot.radius_m + 0.01
        self.grid.mark_obstacle(np.array([[x + c * r, y + s * r]]))
        for _ in range(30):
            self.step(-0.15, 0.0)

    def follow(self, path: Path) -> bool:
        """Drive along the path; False when the map has grown, or something is in the way."""
        began_s, free = self.t_s, self.free_cells()
        points = _without_repeats(path.points_m)
        for i in range(1, len(points)):
            while not self._reached(points, i):
                if self.tick % 20 == 0:
                    grown_m2 = (self.free_cells() - free) * self.mapping.resolution_m**2
                    if grown_m2 >= 1.5 and self.t_s - began_s >= 20.0:
                        return False
                    if self.t_s - began_s >= self.replan_s:
                        return False
                    if self._meets_matter(points[i : i + 8]):
                        return False
                self._steer(points, i)
                if self.blocked:
                    self.bump()
                    return False
        return True

    def _reached(self, points: np.ndarray, i: int) -> bool:
        """Whether the robot has passed waypoint `i`, or is near enough to a gentle bend there."""
        leg, at = points[i] - points[i - 1], np.array([self.pose.x_m, self.pose.y_m])
        left_m = float((points[i] - at) @ leg) / math.hypot(*leg)
        gentle = i + 1 < len(points) and _bend(points[i - 1 : i + 2]) < SHARP_RAD
        return left_m < (0.04 if gentle else 0.008)

    def _steer(self, points: np.ndarray, i: int) -> None:
        """Line-of-sight guidance along the leg to waypoint `i`; large errors are turned away."""
        a, leg = points[i - 1], points[i] - points[i - 1]
        far = math.hypot(*leg)
        off = ((self.pose.x_m - a[0]) * -leg[1] + (self.pose.y_m - a[1]) * leg[0]) / far
        wished = math.atan2(leg[1], leg[0]) - math.atan2(off, 0.12)
        error = (wished - self.pose.yaw_rad + math.pi) % (2 * math.pi) - math.pi
        if abs(error) > SHARP_RAD:
            self.turn_to(wished)
            return
        left_m = float((points[i] - (self.pose.x_m, self.pose.y_m)) @ leg) / far
        last = i + 1 == len(points) or _bend(points[i - 1 : i + 2]) >= SHARP_RAD
        v = min(self.robot.cruise_mps, math.sqrt(2 * 0.6 * max(left_m, 1e-3)) if last else 1.0)
        if self.clearance() < self.robot.radius_m + GRAZE_M:
            v = min(v, NEAR_MPS)
        self.step(max(v, 0.04) * math.cos(error), max(-1.2, min(1.2, 4.0 * error)))

    def _meets_matter(self, points: np.ndarray) -> bool:
        """Whether the map has something on the next waypoints within half a metre or so."""
        view, res = self.grid.snapshot(), self.mapping.resolution_m
        ys, xs = np.nonzero(view.cells == 100)
        matter = np.stack([xs + 0.5, ys + 0.5], 1) * res + (view.origin_x_m, view.origin_y_m)
        at = np.array([self.pose.x_m, self.pose.y_m])
        matter = matter[np.abs(matter - at).max(axis=1) < 1.0]
        for p in points:
            if np.hypot(*(p - at)) > 0.7:
                break
            if len(matter) and np.hypot(*(matter - p).T).min() < self.robot.radius_m - 0.05:
                return True
        return False

    def free_cells(self) -> int:
        """Count of the free cells known now."""
        return int(np.count_nonzero(self.grid.snapshot().cells == 0))

    def clearance(self) -> float:
        """Distance from the robot's centre to matter."""
        return float(self.room[int(self.pose.y_m / CELL_M), int(self.pose.x_m / CELL_M)])

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

    def clean(self, limit_s: float = 1500.0, clock: Callable[[], float] | None = None) -> Run:
        """Back off, look around, and clean until the planner has nothing left."""
        plans, plan_s, finished = [], [], False
        for _ in range(90):
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
            self.plan_index.append(len(self.track))
            for _ in range(1 if self.replan_s < 20 else 10):  # an answer takes its time
                self.step(0.0, 0.0)
            self.follow(answer.path)
        track = np.array(self.track)
        _, floor = self.world.reachable(SE2(*self.track[75][1:]), self.robot)
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


def _bend(three: np.ndarray) -> float:
    """Angle of the corner at the middle point."""
    (ax, ay), (bx, by) = np.diff(three, axis=0)
    return abs(math.atan2(ax * by - ay * bx, ax * bx + ay * by))


def _without_repeats(points: np.ndarray) -> np.ndarray:
    far = np.hypot(*np.diff(points, axis=0).T)
    return points[np.append(True, far > 0.004)]


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
    _, floor = world.reachable(SE2(*run.track[75, 1:]), RobotConfig())
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


def small_flat() -> tuple[FlatWorld, SE2]:
    """About 15 m2 of reachable floor: living room, corridor, bedroom; a table and solid boxes."""
    w = FlatWorld((6.0, 4.2))
    w.box(0.12, 0.12, 3.43, 2.73, False)  # living room
    w.box(0.12, 2.84, 4.42, 4.07, False)  # corridor
    w.box(3.54, 0.12, 5.87, 2.73, False)  # bedroom
    w.box(1.33, 2.73, 2.16, 2.84, False)  # doors
    w.box(3.70, 2.73, 4.42, 2.84, False)
    w.box(2.41, 0.12, 3.43, 0.83)  # sofa
    w.legs(1.07, 1.11, 0.83, 0.62)  # table
    w.box(0.12, 2.30, 0.75, 2.73)  # sideboard
    w.box(4.66, 0.12, 5.87, 1.86)  # bed
    w.box(0.12, 3.72, 0.61, 4.07)  # shoes
    return w, SE2(0.33, 0.77, math.pi)
