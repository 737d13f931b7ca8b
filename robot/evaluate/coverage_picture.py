"""A picture of a sweep: floor, what was left out, and the track in the order it was driven."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from robot.evaluate.coverage import Floor

LONG_SIDE_PX = 1200
WALL, SWEPT, LEFT = (60, 50, 45), (235, 215, 190), (90, 90, 235)  # BGR
FIRST, LAST = np.array([200.0, 90.0, 30.0]), np.array([40.0, 60.0, 220.0])


def draw_coverage(path: Path, floor: Floor, swept: np.ndarray, track: np.ndarray) -> None:
    """Write a PNG. `swept` is bool of the floor's shape, `track` (n, 4) as t_s, x_m, y_m, yaw_rad.

    Swept floor is pale, floor that was left out red; the track turns from blue to red with time.
    """
    picture = np.full((*floor.floor.shape, 3), WALL, np.uint8)
    picture[floor.floor] = LEFT
    picture[floor.floor & swept] = SWEPT
    scale = max(1, LONG_SIDE_PX // max(picture.shape))
    picture = np.ascontiguousarray(picture.repeat(scale, axis=0).repeat(scale, axis=1))
    origin = np.array([floor.origin_x_m, floor.origin_y_m])
    pixels = np.rint((track[:, 1:3] - origin) / floor.resolution_m * scale).astype(int)
    for k in range(1, len(pixels)):
        t = k / len(pixels)
        colour = tuple(float(c) for c in (1.0 - t) * FIRST + t * LAST)
        a, b = (int(v) for v in pixels[k - 1]), (int(v) for v in pixels[k])
        cv2.line(picture, tuple(a), tuple(b), colour, 1, cv2.LINE_AA)
    cv2.imwrite(str(path), picture[::-1])
