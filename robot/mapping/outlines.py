"""The borders of rooms as polygons, for people's maps."""

from __future__ import annotations

import cv2
import numpy as np

from robot.mapping.annotations import Point
from robot.mapping.named_rooms import Rooms

MAX_CORNERS = 60


def outline_m(rooms: Rooms, number: int) -> list[Point]:
    """Corners of a room's largest piece in `world`, through the middles of its border cells.

    Simplified (Douglas and Peucker, 1973) until it has at most `MAX_CORNERS`; empty for no room.
    """
    inside = (rooms.labels == number).astype(np.uint8)
    borders, _ = cv2.findContours(inside, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    if not borders:
        return []
    border = max(borders, key=cv2.contourArea)
    tolerance_cells = 1.0
    while len(corners := cv2.approxPolyDP(border, tolerance_cells, True)) > MAX_CORNERS:
        tolerance_cells *= 1.5
    grid = rooms.grid
    places = (corners.reshape(-1, 2) + 0.5) * grid.resolution_m
    return [
        (round(grid.origin_x_m + float(x), 3), round(grid.origin_y_m + float(y), 3))
        for x, y in places
    ]
