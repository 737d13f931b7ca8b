"""Rooms: free floor divided at its doors.

Doors are where the floor grows narrow. What stays when the floor is eroded by half a door's width
are the rooms' cores; every free cell then belongs to the core that is nearest along the floor (a
watershed of the distance transform: Fabrizi and Saffiotti, ICRA 2000).
"""

from __future__ import annotations

import cv2
import numpy as np

from robot.messages import Grid

_HALF_DOOR_M = 0.50  # passages narrower than twice this divide rooms
_MIN_CORE_M2 = 0.04
_MIN_ROOM_M2 = 1.0
_MIN_SPECK_M2 = 0.5  # smaller pieces of floor without a neighbour are nothing


def segment_rooms(grid: Grid, half_door_m: float = _HALF_DOOR_M) -> np.ndarray:
    """Room numbers int32 of the grid's shape: 1, 2, ... by falling area, 0 where not free."""
    free = (grid.cells >= 0) & (grid.cells < 50)
    labels = _cores(free, grid.resolution_m, half_door_m)
    labels = _spread(labels, free)
    labels = _without_specks(_merged(labels, round(_MIN_ROOM_M2 / grid.resolution_m**2)), grid)
    areas = np.bincount(labels.ravel())
    areas[0] = 0
    order = np.argsort(-areas, kind="stable")
    number = np.zeros(len(areas), np.int32)
    count = int(np.count_nonzero(areas))
    number[order[:count]] = np.arange(1, count + 1)
    return number[labels]


def _cores(free: np.ndarray, cell_m: float, half_door_m: float) -> np.ndarray:
    """Numbered middles of rooms; furniture smaller than a door does not count as a wall."""
    padded = np.pad(free, 1).astype(np.uint8)
    # Legs and boxes standing in the open would look like doors beside each other.
    _, islands, stats, _ = cv2.connectedComponentsWithStats(1 - padded, connectivity=8)
    small = stats[:, cv2.CC_STAT_AREA] * cell_m**2 < 0.3
    small[0] = False
    padded[small[islands]] = 1
    room_m = cv2.distanceTransform(padded, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[1:-1, 1:-1] * cell_m
    core = (room_m > half_door_m).astype(np.uint8)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(core, connectivity=8)
    keep = stats[:, cv2.CC_STAT_AREA] * cell_m**2 >= _MIN_CORE_M2
    keep[0] = False
    number = np.cumsum(keep) * keep
    return np.where(keep[labels], number[labels], 0).astype(np.int32)


def _spread(labels: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Grow the cores over the free cells, one ring at a time; floor without a core is one more."""
    labels = np.where(free, labels, 0).astype(np.int32)
    kernels = (np.ones((3, 3), np.uint8), cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3)))
    for step in range(labels.size):
        grown = cv2.dilate(labels.astype(np.float32), kernels[step % 2]).astype(np.int32)
        new = free & (labels == 0) & (grown > 0)
        if not new.any():
            break
        labels[new] = grown[new]
    alone = (free & (labels == 0)).astype(np.uint8)
    _, parts = cv2.connectedComponents(alone, connectivity=8)
    return np.where(parts > 0, parts + labels.max(), labels).astype(np.int32)


def _merged(labels: np.ndarray, min_cells: int) -> np.ndarray:
    """Give rooms smaller than `min_cells` to the neighbour with the longest common border."""
    while True:
        areas = np.bincount(labels.ravel())
        small = [i for i in np.argsort(areas, kind="stable") if i and 0 < areas[i] < min_cells]
        for room in small:
            ring = cv2.dilate((labels == room).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
            touching = np.bincount(labels[ring], minlength=len(areas))
            touching[[0, room]] = 0
            if touching.any():
                labels = np.where(labels == room, int(touching.argmax()), labels)
                break
        else:
            return labels.astype(np.int32)


def _without_specks(labels: np.ndarray, grid: Grid) -> np.ndarray:
    """Floor seen through a gap, that no room is next to, is no room of its own."""
    areas = np.bincount(labels.ravel()) * grid.resolution_m**2
    areas[0] = 0.0
    speck = areas < min(_MIN_SPECK_M2, areas.max(initial=0.0))
    return np.where(speck[labels], 0, labels)
