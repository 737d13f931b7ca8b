"""Areas to finish one after another: the floor divided where it grows as narrow as a door.

Middles that are wider than a door grow outwards over the floor until they meet (after Fabrizi and
Saffiotti, ICRA 2000). Legs and other small things do not make doors.
"""

from __future__ import annotations

import cv2
import numpy as np

from robot.planning.costmap import Space, distance_m, large_things

_HALF_DOOR_M = 0.45
_LEAST_MIDDLE_M2 = 0.02
_BLOCK_M = 0.10


def label_areas(space: Space) -> np.ndarray:
    """Area number int32 of every cell of the space, 1 and up."""
    room_m = distance_m(large_things(space.matter, space.cell_m), space.cell_m)
    middle = (space.free & (room_m > _HALF_DOOR_M)).astype(np.uint8)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(middle, connectivity=4)
    keep = stats[:, cv2.CC_STAT_AREA] * space.cell_m**2 >= _LEAST_MIDDLE_M2
    keep[0] = False
    if not keep.any():
        return np.ones(labels.shape, np.int32)
    return _grown((np.cumsum(keep) * keep)[labels], space)


def _grown(seeds: np.ndarray, space: Space) -> np.ndarray:
    """Spread the seeds' labels over the floor, ring by ring, in blocks of `_BLOCK_M`."""
    high, wide = seeds.shape
    block = max(1, round(_BLOCK_M / space.cell_m))
    rows, columns = -(-high // block), -(-wide // block)

    def coarse(layer: np.ndarray) -> np.ndarray:
        padded = np.zeros((rows * block, columns * block), layer.dtype)
        padded[:high, :wide] = layer
        return padded.reshape(rows, block, columns, block).max(axis=(1, 3))

    label = coarse(seeds.astype(np.float32))
    floor = coarse(space.centres) | (label > 0)
    kernels = (np.ones((3, 3), np.uint8), cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3)))
    for step in range(rows + columns + rows * columns // 4):
        new = np.where(floor & (label == 0), cv2.dilate(label, kernels[step % 2]), label)
        if step > 0 and np.array_equal(new, label):
            break
        label = new
    # The floor beyond the centres belongs to the nearest of them.
    while (label == 0).any():
        label = np.where(label == 0, cv2.dilate(label, kernels[0]), label)
    return np.kron(label, np.ones((block, block), np.float32))[:high, :wide].astype(np.int32)
