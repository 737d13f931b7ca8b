"""Where the robot's centre may be: the grid turned along the walls, with distances to matter.

Everything the planner draws happens in the plan frame: the grid turned by the walls' dominant
direction, so that lanes are rows and columns, in cells of at most `PLAN_CELL_M`. Points there are
float cells (x, y), (0, 0) being the centre of the first cell.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from robot.config import PlanningConfig, RobotConfig
from robot.geometry.se2 import SE2
from robot.messages import Grid

PLAN_CELL_M = 0.025
SMALL_M = 0.25
_ESCAPE_M = 0.6  # how far the robot may stand from the nearest place where it fits
_BESIDE_M = 0.05  # a robot on an edge is often a little nearer to the wall than planned
_SMALL_PLACE_M2 = 0.5  # of centres: what lies behind a tight gap must be larger
_POCKET_M2 = 0.01  # unknown specks inside free floor are floor


@dataclass(frozen=True, slots=True, eq=False)
class Space:
    """The plan frame's layers, all of one shape (rows = y, columns = x)."""

    cell_m: float
    world_from_plan: SE2  # metric plan frame, its origin at the centre of cell (0, 0)
    clearance_m: np.ndarray  # float32: to the nearest occupied cell's edge
    need_m: float  # clearance that the centre needs
    shy_m: float  # distance of the centre from unknown floor
    matter: np.ndarray  # bool: occupied
    free: np.ndarray  # bool: known and free
    unknown: np.ndarray  # bool
    drivable: np.ndarray  # bool: reachable robot centres
    centres: np.ndarray  # bool: those from which to sweep: `drivable` less tight passages
    floor: np.ndarray  # bool: what the brush reaches from them
    uncovered: np.ndarray  # bool: reachable floor not swept yet
    lost: np.ndarray  # float32, 0 to 1: share of the way that wheels lose by slip
    start: np.ndarray  # (2,) cells: where the robot is
    entry: np.ndarray  # (2,) cells: the start, or the nearest reachable centre if it is off
    heading_rad: float

    def to_world(self, points: np.ndarray) -> np.ndarray:
        """Cells (n, 2) to metres in `world`."""
        return self.world_from_plan.apply(np.asarray(points, float).reshape(-1, 2) * self.cell_m)

    def to_plan(self, points_m: np.ndarray) -> np.ndarray:
        """Metres in `world` (n, 2) to cells."""
        points = np.asarray(points_m, float).reshape(-1, 2)
        return self.world_from_plan.inverse().apply(points) / self.cell_m

    def area_m2(self, mask: np.ndarray) -> float:
        """Area of a mask of this space."""
        return float(np.count_nonzero(mask)) * self.cell_m**2


def disc(radius_cells: float) -> np.ndarray:
    """Structuring element of all cells whose centre is within `radius_cells`."""
    n = math.floor(radius_cells + 1e-6)
    y, x = np.mgrid[-n : n + 1, -n : n + 1]
    return (x * x + y * y <= (radius_cells + 1e-6) ** 2).astype(np.uint8)


def opened(mask: np.ndarray, kernel: np.ndarray) -> np.ndarray:
    """Morphological opening, uint8; cv2's own shifts the picture where a side is even."""
    high, wide = kernel.shape
    eroded = cv2.erode(mask.astype(np.uint8), kernel, anchor=(0, 0))
    mirrored = np.ascontiguousarray(kernel[::-1, ::-1])
    return cv2.dilate(eroded, mirrored, anchor=(wide - 1, high - 1))


def distance_m(blocked: np.ndarray, cell_m: float) -> np.ndarray:
    """From each cell's centre to the edge of the nearest blocked cell, metres (float32)."""
    if not blocked.any():
        return np.full(blocked.shape, 1e3, np.float32)
    clear = np.where(blocked, 0, 255).astype(np.uint8)
    cells = cv2.distanceTransform(clear, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    # Squared distances are whole numbers; the last bit of cv2's root depends on where memory lies.
    cells = np.sqrt(np.rint(cells * cells))
    return (cells - 0.5) * np.float32(cell_m)


def face_distance_m(filled: np.ndarray, cell_m: float) -> np.ndarray:
    """From each cell's centre to the face of the nearest matter, metres (float32).

    `filled` is the percent of each cell that matter fills; of a cell that is in part filled the
    face is taken to stand across the way to it.
    """
    clear = np.where(filled > 0, 0, 255).astype(np.uint8)
    if clear.all():
        return np.full(filled.shape, 1e3, np.float32)
    _, nearest = cv2.distanceTransformWithLabels(
        clear, cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    beyond = np.zeros(int(nearest.max()) + 1, np.float32)
    beyond[nearest[clear == 0]] = 1.0 - filled[clear == 0] / np.float32(100.0)
    return distance_m(clear == 0, cell_m) + beyond[nearest] * np.float32(cell_m)


def large_things(matter: np.ndarray, cell_m: float) -> np.ndarray:
    """Matter without what is smaller than `SMALL_M` both ways: legs, cables, specks."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(matter.astype(np.uint8), connectivity=8)
    side = np.maximum(stats[:, cv2.CC_STAT_WIDTH], stats[:, cv2.CC_STAT_HEIGHT]) * cell_m
    large = side > SMALL_M
    large[0] = False
    return large[labels]


def wall_direction_rad(occupied: np.ndarray) -> float:
    """Dominant direction of walls in [-pi/4, pi/4); 0 where there is none or nearly none.

    The mean of the edges' gradient directions, angles counted four times so that opposite and
    perpendicular walls agree (Mardia and Jupp, Directional Statistics, 2000, section 2.2).
    """
    image = cv2.GaussianBlur(occupied.astype(np.float32), (0, 0), 1.5)
    gx = cv2.Sobel(image, cv2.CV_32F, 1, 0).astype(float)
    gy = cv2.Sobel(image, cv2.CV_32F, 0, 1).astype(float)
    weight = gx * gx + gy * gy
    angle = 4.0 * np.arctan2(gy, gx)
    c, s, total = (weight * np.cos(angle)).sum(), (weight * np.sin(angle)).sum(), weight.sum()
    if total <= 0.0 or math.hypot(c, s) < 0.2 * total:
        return 0.0
    theta = math.atan2(s, c) / 4.0
    # Lanes need not follow every wobble of a growing map.
    return 0.0 if abs(theta) < math.radians(2.5) else round(math.degrees(theta)) * math.pi / 180.0


def without_pockets(unknown: np.ndarray, max_cells: int) -> np.ndarray:
    """Unknown cells less the small enclosed groups of them."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(unknown.astype(np.uint8), connectivity=8)
    large = stats[:, cv2.CC_STAT_AREA] > max_cells
    large[0] = False
    return large[labels]


def build_space(
    grid: Grid,
    covered: np.ndarray,
    start: SE2,
    planning: PlanningConfig,
    robot: RobotConfig,
    lost_pct: np.ndarray | None = None,
) -> Space | None:
    """The plan frame for `start`; None where the robot fits nowhere near it."""
    res = grid.resolution_m
    occupied, unknown = grid.cells >= 50, grid.cells < 0
    unknown = without_pockets(unknown, round(_POCKET_M2 / res**2))
    pad = math.ceil(0.3 / res)  # outside the grid nothing is known
    occupied = np.pad(occupied, pad)
    unknown = np.pad(unknown, pad, constant_values=True)
    covered = np.pad(covered, pad)
    seen = distance_m(unknown, res)
    filled = np.pad(np.maximum(grid.cells, 0), pad)
    large = large_things(filled > 0, res)
    # A leg's far side is known last: keep off it a little more than off a wall.
    thin = distance_m(occupied & ~large, res) - np.float32(planning.thin_margin_m)
    clearance = np.minimum(face_distance_m(np.where(large, filled, 0), res), thin)
    origin = np.array([grid.origin_x_m, grid.origin_y_m]) - pad * res

    cell_m = res / math.ceil(res / PLAN_CELL_M - 1e-9)
    warp, world_from_plan, size = _plan_frame(
        occupied.shape, origin, res, cell_m, wall_direction_rad(occupied)
    )
    nearest = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
    linear = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    clearance = cv2.warpAffine(clearance, warp, size, flags=linear, borderValue=1e3)
    seen = cv2.warpAffine(seen, warp, size, flags=linear, borderValue=-1.0)
    matter = cv2.warpAffine(
        occupied.astype(np.uint8), warp, size, flags=nearest, borderValue=0
    ).astype(bool)
    unseen = cv2.warpAffine(
        unknown.astype(np.uint8), warp, size, flags=nearest, borderValue=1
    ).astype(bool)
    swept = cv2.warpAffine(
        covered.astype(np.uint8), warp, size, flags=nearest, borderValue=0
    ).astype(bool)
    lost = np.zeros_like(clearance)
    if lost_pct is not None:
        lost_pct = np.pad(lost_pct, pad)
        lost = cv2.warpAffine(lost_pct, warp, size, flags=nearest, borderValue=0) / np.float32(100)

    need_m = robot.radius_m + planning.margin_m
    fits = (clearance >= need_m) & (seen >= planning.unknown_clearance_m)
    here = world_from_plan.inverse() @ start
    at = np.array([here.x_m, here.y_m]) / cell_m
    entry = _entry(fits, matter, at, _ESCAPE_M / cell_m)
    if entry is None:
        return None
    drivable, centres = _without_tight_pockets(
        fits, entry, planning.min_passage_m / cell_m, round(_SMALL_PLACE_M2 / cell_m**2)
    )
    brush = disc(robot.brush_width_m / 2.0 / cell_m)
    floor = cv2.dilate(centres.astype(np.uint8), brush).astype(bool) & ~matter & ~unseen
    return Space(
        cell_m,
        world_from_plan,
        clearance,
        need_m,
        planning.unknown_clearance_m,
        matter,
        ~matter & ~unseen,
        unseen,
        drivable,
        centres,
        floor,
        floor & ~swept,
        lost,
        at,
        at
        if math.hypot(entry[0] - at[0], entry[1] - at[1]) <= _BESIDE_M / cell_m
        else np.array(entry, float),
        here.yaw_rad,
    )


def _plan_frame(
    shape: tuple[int, int], origin: np.ndarray, res: float, cell_m: float, theta: float
) -> tuple[np.ndarray, SE2, tuple[int, int]]:
    """Affine map from plan cells to grid cells, its metric pose, and (width, height)."""
    high, wide = shape
    c, s = math.cos(theta), math.sin(theta)
    corners = np.array([[0, 0], [wide, 0], [0, high], [wide, high]], float) * res
    turned = corners @ np.array([[c, -s], [s, c]])  # each row: R(-theta) p
    low, high_m = turned.min(axis=0), turned.max(axis=0)
    size = np.ceil((high_m - low) / cell_m - 1e-6).astype(int)
    first = low + cell_m / 2.0  # centre of plan cell (0, 0) in the turned frame
    at = origin + np.array([c * first[0] - s * first[1], s * first[0] + c * first[1]])
    world_from_plan = SE2(float(at[0]), float(at[1]), theta)
    k = cell_m / res
    offset = (at - origin) / res - 0.5
    warp = np.array([[k * c, -k * s, offset[0]], [k * s, k * c, offset[1]]])
    return warp, world_from_plan, (int(size[0]), int(size[1]))


def _entry(
    fits: np.ndarray, matter: np.ndarray, at: np.ndarray, reach: float
) -> tuple[int, int] | None:
    """The nearest fitting cell (x, y) that a straight line reaches without meeting matter."""
    high, wide = fits.shape
    x0, x1 = max(0, int(at[0] - reach)), min(wide, int(at[0] + reach) + 2)
    y0, y1 = max(0, int(at[1] - reach)), min(high, int(at[1] + reach) + 2)
    if x0 >= x1 or y0 >= y1:
        return None
    ys, xs = np.nonzero(fits[y0:y1, x0:x1])
    if len(xs) == 0:
        return None
    xs, ys = xs + x0, ys + y0
    far = np.hypot(xs - at[0], ys - at[1])
    order = np.argsort(far, kind="stable")
    order = order[far[order] <= reach]
    for i in order[:: max(1, len(order) // 200)]:
        n = max(2, int(far[i]) + 1)
        lx = np.rint(np.linspace(at[0], xs[i], n)).astype(int).clip(0, wide - 1)
        ly = np.rint(np.linspace(at[1], ys[i], n)).astype(int).clip(0, high - 1)
        # The first cells may be the wall that the robot leans on.
        if not matter[ly, lx][min(n - 1, 3) :].any():
            return int(xs[i]), int(ys[i])
    return None


def _without_tight_pockets(
    fits: np.ndarray, entry: tuple[int, int], gap: float, large: int
) -> tuple[np.ndarray, np.ndarray]:
    """(drivable, centres) around `entry`: tight gaps serve only to reach large places.

    `gap` is the least width of a passage of centres, in cells, that leads to a small place.
    """
    whole = _component(fits, entry)
    size = round(gap) + 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    wide = opened(whole, kernel)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(wide, connectivity=8)
    keep = stats[:, cv2.CC_STAT_AREA] >= large
    keep[labels[entry[1], entry[0]]] = True
    keep[0] = False
    kept = keep[labels]
    if not kept.any():
        return whole, whole
    tight = whole & (wide == 0)
    drivable = _component(kept | tight, entry)
    rough = cv2.dilate(kept.astype(np.uint8), disc(gap / 2.0 + 1.0)).astype(bool)
    return drivable, drivable & rough


def _component(mask: np.ndarray, at: tuple[int, int]) -> np.ndarray:
    """The cells of `mask` that hang together with `at` (x, y)."""
    _, labels = cv2.connectedComponents(mask.astype(np.uint8), connectivity=4)
    return labels == labels[at[1], at[0]]
