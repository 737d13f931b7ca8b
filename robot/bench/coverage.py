"""`sweeper bench coverage`: the planner alone, on map_server files, with the true pose.

A robot that knows the whole map drives every plan exactly, and the planner is asked again until it
has nothing more to say. What is measured is what planning costs: floor left out, metres driven
over the metres that a brush needs that sweeps nothing twice, and time.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from statistics import mean
from typing import Any

import cv2
import msgspec
import numpy as np

from robot.config import Config, RobotConfig
from robot.errors import MapError
from robot.evaluate.coverage import Floor, area_m2, path_ratio, swept_mask
from robot.evaluate.coverage_picture import draw_coverage
from robot.geometry.se2 import SE2
from robot.mapping.map_server import grid_from_map_server, parse_map_info
from robot.messages import Grid, PlanOrder
from robot.planning.worker import plan

FINER = 4  # a map's cells are split, so that the robot's round shape is met
STEP_M = 0.02
MAX_PLANS = 12


@dataclass(frozen=True, slots=True, eq=False)
class Reachable:
    """Where the robot fits and what its brush reaches from there. See `evaluate.coverage.Floor`."""

    resolution_m: float
    origin_x_m: float
    origin_y_m: float
    centres: np.ndarray
    floor: np.ndarray


def bench_coverage(paths: Sequence[Path], config: Config, out_dir: Path) -> dict[str, Any]:
    """Plan on every map (*.yaml) among `paths` (files, or folders of them); pictures to `out_dir`.

    Raises MapError for a map that cannot be read or where the robot fits nowhere.
    """
    out_dir.mkdir(parents=True, exist_ok=True)
    # Map and pose are exact here: no room has to be kept for their errors.
    exact = msgspec.structs.replace(
        config.planning, margin_m=0.0, thin_margin_m=0.0, lane_overlap_m=0.0, horizon_m=0.0
    )
    config = msgspec.structs.replace(config, planning=exact)
    rows = [_measure(path, config, out_dir) for path in _maps(paths)]
    figures = [key for key in rows[0] if key != "name"]
    return {"maps": rows, "mean": {key: mean(row[key] for row in rows) for key in figures}}


def _maps(paths: Sequence[Path]) -> list[Path]:
    found: list[Path] = []
    for path in paths:
        found += sorted(path.glob("*.yaml")) if path.is_dir() else [path]
    if not found:
        raise MapError(f"{paths[0]}: holds no map; give map_server files (*.yaml with their PGM).")
    return found


def _read(path: Path) -> Grid:
    image = path
    try:
        text = path.read_text(encoding="utf-8")
        image = path.parent / parse_map_info(text, str(path)).image
        return grid_from_map_server(image.read_bytes(), text, str(path))
    except (OSError, UnicodeDecodeError) as error:
        raise MapError(f"{image}: cannot be read ({error}); give the map's YAML and PGM.") from None


def reachable(grid: Grid, robot: RobotConfig) -> Reachable:
    """The largest floor of a map that one robot can reach; unknown cells are walls.

    Raises MapError where the robot fits nowhere.
    """
    free = np.kron(grid.cells == 0, np.ones((FINER, FINER), bool))
    free = np.pad(free, 1)
    cell_m = grid.resolution_m / FINER
    far_m = (cv2.distanceTransform(free.astype(np.uint8), cv2.DIST_L2, 5) - 0.5) * cell_m
    fits = (far_m >= robot.radius_m)[1:-1, 1:-1]
    _, labels, stats, _ = cv2.connectedComponentsWithStats(fits.astype(np.uint8), connectivity=4)
    if len(stats) < 2:
        raise MapError("the robot fits nowhere on this map; check its resolution and free_thresh.")
    centres = labels == 1 + int(stats[1:, cv2.CC_STAT_AREA].argmax())
    away = cv2.distanceTransform((~centres).astype(np.uint8), cv2.DIST_L2, 5)
    floor = (away * cell_m <= robot.brush_width_m / 2.0) & free[1:-1, 1:-1]
    return Reachable(cell_m, grid.origin_x_m, grid.origin_y_m, centres, floor)


def _measure(path: Path, config: Config, out_dir: Path) -> dict[str, Any]:
    grid = _read(path)
    try:
        floor = reachable(grid, config.robot)
    except MapError as error:
        raise MapError(f"{path}: {error}") from None
    track, plan_s = sweep(grid, _roomiest(floor), config)
    brush_m = config.robot.brush_width_m
    swept = swept_mask(floor, track, brush_m)
    steps = np.diff(track[:, 1:3], axis=0)
    path_m = float(np.hypot(*steps.T).sum())
    done = int(np.count_nonzero(swept & floor.floor))
    draw_coverage(out_dir / f"{path.stem}.png", floor, swept, track)
    return {
        "name": path.stem,
        "reachable_m2": round(area_m2(floor), 2),
        "covered_pct": round(100.0 * done / int(np.count_nonzero(floor.floor)), 2),
        "path_m": round(path_m, 1),
        "path_ratio": round(path_ratio(floor, track, brush_m), 3),
        "overlap_pct": round(_overlap_pct(floor, done, path_m, brush_m), 1),
        "plan_s": round(plan_s, 3),
    }


def _overlap_pct(floor: Floor, cells: int, path_m: float, brush_m: float) -> float:
    """Share of the brushed area that was brushed before (or is no floor)."""
    brushed_m2 = max(path_m * brush_m, 1e-9)
    return 100.0 * max(0.0, 1.0 - cells * floor.resolution_m**2 / brushed_m2)


def _roomiest(floor: Reachable) -> SE2:
    """The reachable place farthest from everything, as a robot would be put down."""
    room = cv2.distanceTransform(floor.centres.astype(np.uint8), cv2.DIST_L2, 5)
    row, column = np.unravel_index(int(room.argmax()), room.shape)
    cell_m = floor.resolution_m
    return SE2(
        floor.origin_x_m + (float(column) + 0.5) * cell_m,
        floor.origin_y_m + (float(row) + 0.5) * cell_m,
    )


def sweep(grid: Grid, start: SE2, config: Config) -> tuple[np.ndarray, float]:
    """All plans driven exactly: track (n, 4) of t_s, x_m, y_m, yaw_rad; slowest plan, CPU s."""
    reach = _SweptCells(grid, config.robot.brush_width_m)
    pose, tracks, slowest_s = start, [np.array([[0.0, start.x_m, start.y_m, 0.0]])], 0.0
    for number in range(MAX_PLANS):
        order = PlanOrder(0, number, "coverage", grid, reach.cells(), pose)
        began_s = time.thread_time()
        answer = plan(order, config.planning, config.robot)
        slowest_s = max(slowest_s, time.thread_time() - began_s)
        if len(answer.path.points_m) < 2:
            break
        track = _driven(answer.path.points_m, float(len(tracks[-1])))
        reach.sweep(track)
        tracks.append(track)
        pose = SE2(*track[-1, 1:])
    return np.concatenate(tracks), slowest_s


class _SweptCells:
    """The cells of a grid that a track has swept, for the next plan."""

    def __init__(self, grid: Grid, brush_m: float) -> None:
        everywhere = np.ones(grid.cells.shape, bool)
        self._floor = Reachable(
            grid.resolution_m, grid.origin_x_m, grid.origin_y_m, everywhere, everywhere
        )
        self._brush_m = brush_m
        self._done = np.zeros(grid.cells.shape, bool)

    def sweep(self, track: np.ndarray) -> None:
        self._done |= swept_mask(self._floor, track, self._brush_m)

    def cells(self) -> np.ndarray:
        return self._done.copy()


def _driven(points_m: np.ndarray, t_s: float) -> np.ndarray:
    """A polyline (n, 2) as poses every `STEP_M`, turning on the spot at its corners."""
    rows = []
    for a, b in pairwise(points_m):
        leg = b - a
        length_m = float(np.hypot(*leg))
        count = max(1, round(length_m / STEP_M))
        yaw = np.full(count + 1, np.arctan2(leg[1], leg[0]))
        at = a + np.linspace(0.0, 1.0, count + 1)[:, None] * leg
        rows.append(np.column_stack([at, yaw]))
    poses = np.concatenate(rows)
    return np.column_stack([t_s + np.arange(len(poses)), poses])
