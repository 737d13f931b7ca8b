"""How what the robot knows is shown to people: the map as tiles, landmarks as rows, pictures."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from robot.body.talk import stream
from robot.body.talk.stream import Place
from robot.messages import Grid, MapReport

JPEG = [cv2.IMWRITE_JPEG_QUALITY, 70]
THERMOMETER = Path("/sys/class/thermal/thermal_zone0/temp")


def cut_tiles(grid: Grid, covered: np.ndarray) -> dict[Place, bytes]:
    """Tiles of `robot.body.talk.stream` with anything known in them."""
    size = stream.TILE
    cells: np.ndarray = np.full(grid.cells.shape, stream.UNKNOWN, np.uint8)
    cells[(grid.cells >= 0) & (grid.cells < 50)] = stream.FREE
    cells[covered & (cells == stream.FREE)] = stream.SWEPT
    cells[grid.cells >= 50] = stream.OCCUPIED
    ix0 = round(grid.origin_x_m / grid.resolution_m)
    iy0 = round(grid.origin_y_m / grid.resolution_m)
    rows, columns = cells.shape
    left, low = ix0 % size, iy0 % size
    wide, high = -(-(left + columns) // size), -(-(low + rows) // size)
    paper = np.zeros((high * size, wide * size), np.uint8)
    paper[low : low + rows, left : left + columns] = cells
    tiles = paper.reshape(high, size, wide, size).swapaxes(1, 2)
    known = tiles.any(axis=(2, 3))
    places: list[list[int]] = np.argwhere(known).tolist()
    return {(ix0 // size + i, iy0 // size + j): tiles[j, i].tobytes() for j, i in places}


def landmark_rows(report: MapReport) -> list[list[float]]:
    """x, y, and the covariance's xx, xy, yy of every landmark."""
    rows = np.column_stack(
        [
            report.landmarks_m.reshape(-1, 2),
            report.landmark_cov.reshape(-1, 4)[:, [0, 1, 3]],
        ]
    )
    return [[float(f"{v:.4g}") for v in row] for row in rows if np.isfinite(row).all()]


def jpeg(image: np.ndarray) -> bytes:
    """A picture small enough for a live view."""
    return cv2.imencode(".jpg", image, JPEG)[1].tobytes()


def coloured(disparity_px: np.ndarray, most_px: float = 48.0) -> np.ndarray:
    """Near is red, far is blue, unknown is black; BGR (h, w, 3)."""
    known = np.isfinite(disparity_px)
    scaled = np.clip(np.where(known, disparity_px, 0.0) * (255.0 / most_px), 0, 255)
    colours = cv2.applyColorMap(scaled.astype(np.uint8), cv2.COLORMAP_TURBO)
    colours[~known] = 0
    return np.asarray(colours)


def temperature_c() -> float | None:
    """Of the processor, where the system knows it."""
    try:
        return round(int(THERMOMETER.read_text()) / 1000.0, 1)
    except (OSError, ValueError):
        return None
