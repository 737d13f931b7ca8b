"""Lanes to and fro over what the edge pass leaves: boustrophedon cells.

A region is swept by parallel rows. Rows are grouped into cells: a run of lane follows the run
before it as long as each overlaps only the other (Choset, Autonomous Robots 2000, at the
granularity of lanes). The direction of a region is the one with the lower cost.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from robot.config import PlanningConfig
from robot.planning.costmap import Space, opened

_NECK_M = 0.35  # regions joined by less than this are swept apart
_HABIT = 1.15
_BRIDGE_M = 0.40  # swept gaps in a lane shorter than this are driven through


@dataclass(frozen=True, slots=True, eq=False)
class Cell:
    """Runs of lane (n, 2, 2) in cells, in sweeping order; each from its low to its high end.

    `gain` is how many cells they sweep.
    """

    runs: np.ndarray
    area: int
    gain: int


@dataclass(frozen=True, slots=True)
class LaneRules:
    """What lanes need to know, in cells."""

    brush: float
    spacing: float
    bridge: int
    turn: float
    least_gain: int


def lane_rules(space: Space, planning: PlanningConfig, brush_m: float) -> LaneRules:
    """The rules for `space`."""
    spacing_m = max(0.25 * brush_m, brush_m - planning.lane_overlap_m)
    return LaneRules(
        brush_m / space.cell_m,
        spacing_m / space.cell_m,
        round(_BRIDGE_M / space.cell_m),
        planning.turn_cost_m / space.cell_m,
        max(1, round(0.5 * planning.min_patch_m2 / space.cell_m**2)),
    )


def lane_cells(space: Space, todo: np.ndarray, areas: np.ndarray, rules: LaneRules) -> list[Cell]:
    """Cells whose lanes sweep `todo` from reachable centres, each in one of the `areas`."""
    cells: list[Cell] = []
    for area in np.unique(areas[todo]):
        cells += _area_cells(space, todo & (areas == area), int(area), rules)
    return cells


def _area_cells(space: Space, todo: np.ndarray, area: int, rules: LaneRules) -> list[Cell]:
    cells: list[Cell] = []
    around = _boxes(todo.astype(np.int32), round(2.0 * _NECK_M / space.cell_m))[0]
    assert around is not None
    labels, _ = regions(todo[around], _NECK_M / space.cell_m)
    size = np.bincount(labels.ravel())
    for label, box in enumerate(_boxes(labels, int(rules.brush)), start=1):
        if box is None or size[label] < rules.least_gain:
            continue
        corner = np.array([box[1].start + around[1].start, box[0].start + around[0].start], float)
        part, centres = labels[box] == label, space.centres[around][box]
        here = space.entry - corner
        rows = _lanes(part, centres, float(here[1]), rules)
        columns = _lanes(part.T, centres.T, float(here[0]), rules)
        # Whoever has begun in one direction goes on in it unless the other is clearly better.
        habit = _habit(here, space.heading_rad, part.shape, rules)
        turned = habit * _cost(columns, rules) < _cost(rows, rules)
        for runs in _grouped(columns if turned else rows):
            ends = np.stack([runs[:, [1, 0]], runs[:, [2, 0]]], axis=1)
            ends = (ends[:, :, ::-1] if turned else ends) + corner
            cells.append(Cell(ends, area, int(runs[:, 3].sum())))
    return cells


def _boxes(labels: np.ndarray, margin: int) -> list[tuple[slice, slice] | None]:
    """Rows and columns around each label from 1 on, `margin` wider; None: there is none of it."""
    from scipy.ndimage import find_objects

    return [
        box
        and (
            slice(max(0, box[0].start - margin), box[0].stop + margin),
            slice(max(0, box[1].start - margin), box[1].stop + margin),
        )
        for box in find_objects(labels)
    ]


def regions(todo: np.ndarray, neck: float) -> tuple[np.ndarray, int]:
    """Label the parts of `todo` that hang together by more than `neck` cells; 0 is background."""
    size = max(3, round(neck) | 1)
    mask: np.ndarray = todo.astype(np.uint8)
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    core = opened(mask, kernel)
    core_count, core_labels = cv2.connectedComponents(core, connectivity=4)
    rest = np.where(core > 0, 0, mask).astype(np.uint8)
    if core_count > 1:
        # Fringes belong to the core beside them; what is farther away stands alone.
        far, nearest = cv2.distanceTransformWithLabels(
            1 - core, cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
        )
        table = np.zeros(int(nearest.max()) + 1, core_labels.dtype)
        table[nearest[core > 0]] = core_labels[core > 0]
        fringe = (rest > 0) & (far <= size)
        core_labels = np.where(fringe, table[nearest], core_labels)
        rest[fringe] = 0
    rest_count, rest_labels = cv2.connectedComponents(rest, connectivity=8)
    labels = np.where(rest_labels > 0, rest_labels + (core_count - 1), core_labels)
    return labels, core_count + rest_count - 1


def _habit(here: np.ndarray, heading: float, shape: tuple[int, int], rules: LaneRules) -> float:
    """Weight of columns against rows, from the heading of a robot in or beside the region."""
    high, wide = shape
    margin = rules.brush
    if not (-margin <= here[0] < wide + margin and -margin <= here[1] < high + margin):
        return 1.0
    along = abs(math.cos(heading))
    if along > 0.9:
        return _HABIT
    return 1.0 / _HABIT if along < 0.44 else 1.0


def _lanes(
    part: np.ndarray, centres: np.ndarray, here: float, rules: LaneRules
) -> list[np.ndarray]:
    """Runs (n, 4) of each row lane over `part`: y, first x, last x, cells swept.

    Lanes are counted from the side that is nearer to the robot's row `here`, so that they lie
    where they lay in the plan before; only the last one may overlap more.
    """
    rows = np.flatnonzero(part.any(axis=1))
    low, high = int(rows[0]), int(rows[-1]) + 1
    count = max(1, math.ceil((high - low) / rules.spacing - 1e-6))
    half = rules.brush / 2.0
    inset = half - (rules.brush - rules.spacing) / 2.0
    first, last = low + inset - 0.5, high - inset - 0.5
    if count == 1:
        middles = [(first + last) / 2.0]
    elif here - low <= high - here:
        middles = [min(first + k * rules.spacing, last) for k in range(count)]
    else:
        middles = [max(last - k * rules.spacing, first) for k in range(count)][::-1]
    lanes = []
    for y in middles:
        row = min(max(round(y), 0), len(part) - 1)
        band = part[max(0, math.ceil(y - half)) : math.floor(y + half) + 1]
        lanes.append(_runs_of_lane(np.count_nonzero(band, axis=0), centres[row], row, rules))
    return lanes


def _runs_of_lane(gain: np.ndarray, fits: np.ndarray, row: int, rules: LaneRules) -> np.ndarray:
    """Join the columns to sweep into runs through fitting cells."""
    on = np.flatnonzero((gain > 0) & fits)
    if len(on) == 0:
        return np.zeros((0, 4))
    blocked = np.concatenate([[0], np.cumsum(~fits)])
    split = (np.diff(on) > rules.bridge) | (blocked[on[1:]] != blocked[on[:-1]])
    cuts = np.flatnonzero(split) + 1
    groups = [g for g in np.split(on, cuts) if gain[g].sum() >= rules.least_gain]
    return np.array([(row, g[0], g[-1], gain[g].sum()) for g in groups], float).reshape(-1, 4)


def _cost(lanes: list[np.ndarray], rules: LaneRules) -> float:
    """Length of all runs and of the two turns after each."""
    runs = np.vstack(lanes)
    if len(runs) == 0:
        return float("inf")
    return float((runs[:, 2] - runs[:, 1]).sum() + len(runs) * (2.0 * rules.turn + rules.spacing))


def _grouped(lanes: list[np.ndarray]) -> list[np.ndarray]:
    """Chain runs of neighbouring lanes that overlap one to one."""
    open_cells: list[list[np.ndarray]] = []
    done: list[list[np.ndarray]] = []
    for runs in lanes:
        overlaps = [
            [k for k, r in enumerate(runs) if r[1] <= cell[-1][2] and cell[-1][1] <= r[2]]
            for cell in open_cells
        ]
        owners = [[c for c, over in enumerate(overlaps) if k in over] for k in range(len(runs))]
        going: list[list[np.ndarray]] = []
        for c, cell in enumerate(open_cells):
            if len(overlaps[c]) == 1 and len(owners[overlaps[c][0]]) == 1:
                cell.append(runs[overlaps[c][0]])
                going.append(cell)
            else:
                done.append(cell)
        for k, run in enumerate(runs):
            if not (len(owners[k]) == 1 and len(overlaps[owners[k][0]]) == 1):
                going.append([run])
        open_cells = going
    return [np.array(cell) for cell in done + open_cells]
