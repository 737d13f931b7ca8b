"""The picture of a run: rooms, swept floor, obstacles, tracks, landmarks, dock."""

from __future__ import annotations

import math

import cv2
import numpy as np

from robot.evaluate.canvas import Canvas, Colour
from robot.messages import MapReport

PAPER: Colour = (243, 244, 246)
OCCUPIED: Colour = (44, 52, 64)
FREE: Colour = (255, 255, 255)
INK: Colour = (55, 65, 81)
ESTIMATE: Colour = (29, 64, 175)
TRUTH: Colour = (234, 120, 20)
LANDMARK: Colour = (190, 24, 93)
DOCK: Colour = (22, 130, 70)
# Pale, and distinct in hue for people with colour-weak eyes as well (after Okabe and Ito, 2008).
TINTS: tuple[Colour, ...] = (
    (204, 229, 246),
    (252, 226, 190),
    (204, 236, 220),
    (240, 214, 232),
    (246, 240, 190),
    (222, 218, 244),
    (226, 226, 218),
    (250, 212, 204),
)
ELLIPSE_SIGMAS = 2.0

_PANEL_PX = (250, 400)
_LONGEST_PX = 1100
_MARGIN_M = 0.3
_ROOM_M2 = 1.0  # less is not called a room
_DOCK_M = (0.17, 0.26, 0.13)  # front, back and half width of the plate, in `world`


def draw_map(
    report: MapReport,
    rooms: np.ndarray | None,
    estimate: np.ndarray,
    truth: np.ndarray | None = None,
    *,
    caption: str = "",
    robot_radius_m: float = 0.17,
) -> bytes:
    """PNG of the map with its tracks.

    `rooms` holds a label per cell of the grid (0: none), `estimate` and `truth` are tracks (n, 4)
    of t_s, x_m, y_m, yaw_rad in `world`, the frame of the grid.
    """
    picture = picture_of_map(
        report, rooms, estimate, truth, caption=caption, robot_radius_m=robot_radius_m
    )
    return bytes(cv2.imencode(".png", picture[..., ::-1])[1].tobytes())


def picture_of_map(
    report: MapReport,
    rooms: np.ndarray | None,
    estimate: np.ndarray,
    truth: np.ndarray | None = None,
    *,
    caption: str = "",
    robot_radius_m: float = 0.17,
) -> np.ndarray:
    """As `draw_map`, but the picture itself: uint8 (h, w, 3), red first."""
    tracks = [track for track in (estimate, truth) if track is not None and len(track)]
    report, rooms = _cut_out(report, rooms, tracks)
    if rooms is not None:
        rooms = _large_rooms(rooms, report.grid.resolution_m)
    canvas = _paper(report)
    canvas.paint_cells(_floor_colours(report, rooms))
    if truth is not None:
        canvas.polyline(truth[:, 1:3], TRUTH, 1.6, opacity=0.9)
    canvas.polyline(estimate[:, 1:3], ESTIMATE, 1.5, opacity=0.8)
    _draw_landmarks(canvas, report)
    _draw_dock(canvas)
    if len(estimate):
        _draw_robot(canvas, estimate[-1, 1:], robot_radius_m)
    if rooms is not None:
        _name_rooms(canvas, report, rooms)
    _draw_panel(canvas, report, truth is not None, caption)
    return canvas.finished()


# ---------------------------------------------------------------- what is shown


def _cut_out(
    report: MapReport, rooms: np.ndarray | None, tracks: list[np.ndarray]
) -> tuple[MapReport, np.ndarray | None]:
    """The part of the map that is known or driven through, with a margin; padded if need be."""
    grid = report.grid
    rows, columns = np.nonzero(grid.cells >= 0)
    corners = [np.array([[_DOCK_M[0], -_DOCK_M[2]], [_DOCK_M[1], _DOCK_M[2]]])]
    corners += [track[:, 1:3] for track in tracks]
    if rows.size:
        cells = np.array([[columns.min(), rows.min()], [columns.max() + 1, rows.max() + 1]])
        corners.append(cells * grid.resolution_m + (grid.origin_x_m, grid.origin_y_m))
    points = np.concatenate(corners)
    low, high = points.min(axis=0) - _MARGIN_M, points.max(axis=0) + _MARGIN_M
    origin = np.array([grid.origin_x_m, grid.origin_y_m])
    first = np.floor((low - origin) / grid.resolution_m + 1e-9).astype(int)[::-1]
    last = np.ceil((high - origin) / grid.resolution_m - 1e-9).astype(int)[::-1]
    window = (first, last)
    cut_grid = type(grid)(
        grid.resolution_m,
        grid.origin_x_m + float(first[1]) * grid.resolution_m,
        grid.origin_y_m + float(first[0]) * grid.resolution_m,
        _window(grid.cells, window, -1),
    )
    cut = MapReport(
        report.t_ns,
        cut_grid,
        _window(report.covered, window, 0),
        report.landmarks_m,
        report.landmark_cov,
    )
    return cut, None if rooms is None else _window(rooms, window, 0)


def _large_rooms(rooms: np.ndarray, resolution_m: float) -> np.ndarray:
    """The labels without those of scraps, such as floor glimpsed through a gap."""
    area_m2 = np.bincount(rooms.ravel()) * resolution_m**2
    return np.where(area_m2[rooms] >= _ROOM_M2, rooms, 0)


def _window(array: np.ndarray, window: tuple[np.ndarray, np.ndarray], fill: int) -> np.ndarray:
    """Rows and columns from window[0] to window[1], which may reach beyond the array."""
    first, last = window
    result = np.full(tuple(last - first), fill, array.dtype)
    low = np.maximum(first, 0)
    high = np.minimum(last, array.shape)
    if np.all(high > low):
        to, until = low - first, high - first
        part = array[low[0] : high[0], low[1] : high[1]]
        result[to[0] : until[0], to[1] : until[1]] = part
    return result


def _paper(report: MapReport) -> Canvas:
    grid = report.grid
    return Canvas(
        (grid.cells.shape[0], grid.cells.shape[1]),
        grid.resolution_m,
        (grid.origin_x_m, grid.origin_y_m),
        min(8.0, _LONGEST_PX / max(grid.cells.shape)),
        _PANEL_PX,
        PAPER,
    )


def _floor_colours(report: MapReport, rooms: np.ndarray | None) -> np.ndarray:
    cells = report.grid.cells
    colours = np.full((*cells.shape, 3), PAPER, np.uint8)
    free = (cells >= 0) & (cells < 50)
    colours[free] = FREE
    if rooms is not None:
        tinted = free & (rooms > 0)
        colours[tinted] = np.array(TINTS, np.uint8)[(rooms[tinted] - 1) % len(TINTS)]
    swept = report.covered & (cells < 50)
    colours[swept] = swept_colour(colours[swept])
    colours[cells >= 50] = OCCUPIED
    return colours


def swept_colour(floor: np.ndarray) -> np.ndarray:
    """Colour of floor (..., 3) once it is swept: the same hue, deeper."""
    share = np.asarray(floor) / 255.0
    return np.asarray(np.round(237.0 * share**2.2), dtype=np.uint8)


# ---------------------------------------------------------------- what is drawn on it


def _draw_landmarks(canvas: Canvas, report: MapReport) -> None:
    circle = np.linspace(0.0, 2.0 * math.pi, 32, endpoint=False)
    unit = np.column_stack([np.cos(circle), np.sin(circle)]) * ELLIPSE_SIGMAS
    for centre, cov in zip(report.landmarks_m, report.landmark_cov, strict=True):
        if not (np.isfinite(centre).all() and np.isfinite(cov).all()):
            continue
        values, vectors = np.linalg.eigh(cov)
        ellipse = centre + (unit * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
        canvas.polyline(ellipse, LANDMARK, 0.8, closed=True)
        canvas.disc(centre, 1.8, LANDMARK)


def _draw_dock(canvas: Canvas) -> None:
    front, back, half = _DOCK_M
    canvas.polygon(np.array([[front, -half], [back, -half], [back, half], [front, half]]), DOCK)


def _draw_robot(canvas: Canvas, pose: np.ndarray, radius_m: float) -> None:
    x, y, yaw = pose
    circle = np.linspace(0.0, 2.0 * math.pi, 48, endpoint=False)
    rim = np.column_stack([x + radius_m * np.cos(circle), y + radius_m * np.sin(circle)])
    canvas.polyline(rim, INK, 1.5, closed=True)
    nose = np.array([[x, y], [x + radius_m * math.cos(yaw), y + radius_m * math.sin(yaw)]])
    canvas.polyline(nose, INK, 1.5)


def _name_rooms(canvas: Canvas, report: MapReport, rooms: np.ndarray) -> None:
    """A number and the area, where the room is widest."""
    grid = report.grid
    for label in (int(v) for v in np.unique(rooms) if v > 0):
        mask = np.pad((rooms == label).astype(np.uint8), 1)
        room_to_wall = cv2.distanceTransform(mask, cv2.DIST_L2, 3)[1:-1, 1:-1]
        row, column = np.unravel_index(int(room_to_wall.argmax()), room_to_wall.shape)
        x, y = canvas.px_from_m(
            (
                grid.origin_x_m + (float(column) + 0.5) * grid.resolution_m,
                grid.origin_y_m + (float(row) + 0.5) * grid.resolution_m,
            )
        )
        area = float(mask.sum()) * grid.resolution_m**2
        canvas.text_px(f"room {label}", (x, y), INK, size_px=15, centred=True, halo=FREE)
        canvas.text_px(f"{area:.1f} m2", (x, y + 17), INK, size_px=12, centred=True, halo=FREE)


def _draw_panel(canvas: Canvas, report: MapReport, with_truth: bool, caption: str) -> None:
    """Legend, caption and scale bar in the panel at the right."""
    left, y = canvas.map_width_px + 22.0, 34.0
    for line in caption.splitlines():
        canvas.text_px(line, (left, y), INK, size_px=13)
        y += 22.0
    y += 8.0 if caption else 0.0
    tint = TINTS[0]
    swatches: list[tuple[Colour, str, float]] = [
        (tint, "floor of a room", 14.0),
        (tuple(int(v) for v in swept_colour(np.array(tint))), "swept floor", 14.0),  # type: ignore[list-item]
        (OCCUPIED, "obstacle", 14.0),
        (ESTIMATE, "estimated track", 3.0),
        *([(TRUTH, "true track", 3.0)] if with_truth else []),
        (LANDMARK, f"{len(report.landmarks_m)} landmarks, {ELLIPSE_SIGMAS:.0f} sigma", 5.0),
        (DOCK, "dock", 14.0),
    ]
    for colour, words, height in swatches:
        canvas.rectangle_px((left, y - 5.0 - height / 2), (26.0, height), colour)
        canvas.text_px(words, (left + 38.0, y), INK, size_px=14)
        y += 26.0
    _draw_scale(canvas, left, max(y + 14.0, canvas.height_px - 24.0))


def _draw_scale(canvas: Canvas, left: float, y: float) -> None:
    length_m = next(m for m in (0.5, 1.0, 2.0, 5.0, 10.0, 50.0) if canvas.length_px(m) > 90.0)
    width = canvas.length_px(length_m)
    canvas.rectangle_px((left, y), (width, 3.0), INK)
    for x in (left, left + width - 2.0):
        canvas.rectangle_px((x, y - 5.0), (2.0, 13.0), INK)
    canvas.text_px(f"{length_m:g} m", (left + width / 2, y - 10.0), INK, centred=True)
