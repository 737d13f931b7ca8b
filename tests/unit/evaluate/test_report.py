"""The picture of a run shows what the map and the tracks say, where they say it."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from robot.evaluate import report as look
from robot.evaluate.report import draw_map, picture_of_map, swept_colour
from robot.messages import Grid, MapReport

CELL_M, CELL_PX = 0.1, 8  # eight pixels a cell is the largest scale
NO_LANDMARKS = (np.empty((0, 2)), np.empty((0, 2, 2)))


def home(landmarks: tuple[np.ndarray, np.ndarray] = NO_LANDMARKS) -> tuple[MapReport, np.ndarray]:
    """A known floor of 4 m x 3 m from (-1, -1), one wall, two rooms, a swept corner."""
    cells = np.full((50, 60), -1, np.int8)  # the rest of the grid is unknown
    cells[10:40, 10:50] = 0
    cells[10, 10:50] = 100
    rooms = np.zeros(cells.shape, int)
    rooms[11:40, 10:30], rooms[11:40, 30:50] = 1, 2
    covered = np.zeros(cells.shape, bool)
    covered[20:40, 10:20] = True
    return MapReport(0, Grid(CELL_M, -2.0, -2.0, cells), covered, *landmarks), rooms


def track(*points: tuple[float, float]) -> np.ndarray:
    return np.array([(i, x, y, 0.0) for i, (x, y) in enumerate(points)])


def colour_at(picture: np.ndarray, x_m: float, y_m: float) -> tuple[int, ...]:
    """Colour of the picture at a place of the world; the cut-out starts 0.3 m outside the floor."""
    column = (x_m + 1.0 + 0.3) / CELL_M * CELL_PX
    row = picture.shape[0] - (y_m + 1.0 + 0.3) / CELL_M * CELL_PX
    return tuple(int(v) for v in picture[int(row), int(column)])


def shows(picture: np.ndarray, x_m: float, y_m: float, wanted: look.Colour) -> bool:
    """Whether a line of this colour passes within a pixel of a place."""
    pixel_m = CELL_M / CELL_PX
    around = [
        colour_at(picture, x_m + i * pixel_m, y_m + j * pixel_m)
        for i in (-1, 0, 1)
        for j in (-1, 0, 1)
    ]
    return min(max(abs(np.subtract(colour, wanted))) for colour in around) <= 60


NOWHERE = np.empty((0, 4))


def test_floor_rooms_walls_and_the_unknown_have_their_colours() -> None:
    report, rooms = home()
    picture = picture_of_map(report, rooms, NOWHERE)
    assert picture.shape == (400, 46 * CELL_PX + 250, 3)
    assert colour_at(picture, 0.55, -0.55) == look.TINTS[0]
    assert colour_at(picture, 2.55, -0.55) == look.TINTS[1]
    assert colour_at(picture, 2.55, -0.95) == look.OCCUPIED
    assert colour_at(picture, -1.15, 1.0) == look.PAPER
    swept = tuple(swept_colour(np.array(look.TINTS[0])).tolist())
    assert colour_at(picture, -0.75, 1.75) == swept != look.TINTS[0]
    assert colour_at(picture_of_map(report, None, NOWHERE), 2.55, 0.05) == look.FREE


def test_a_scrap_of_floor_is_no_room() -> None:
    report, rooms = home()
    rooms[30:34, 40:44] = 3  # 0.16 m2
    picture = picture_of_map(report, rooms, NOWHERE)
    assert colour_at(picture, 2.25, 1.25) == look.FREE
    assert colour_at(picture, 2.75, 1.25) == look.TINTS[1]


def test_y_points_up_and_the_dock_stands_before_the_start() -> None:
    report, rooms = home()
    picture = picture_of_map(report, rooms, NOWHERE)
    assert colour_at(picture, 0.215, -0.1) == look.DOCK
    assert colour_at(picture, -0.215, -0.1) != look.DOCK
    assert colour_at(picture, -0.75, -0.15) == look.TINTS[0]  # below the swept corner


def test_both_tracks_are_drawn_where_they_went() -> None:
    report, rooms = home()
    estimate, truth = track((-0.5, 1.0), (2.5, 1.0)), track((-0.5, 1.3), (2.5, 1.3))
    picture = picture_of_map(report, rooms, estimate, truth)
    for x in (0.0, 1.0, 2.0):
        assert shows(picture, x, 1.0, look.ESTIMATE)
        assert shows(picture, x, 1.3, look.TRUTH)
    alone = picture_of_map(report, rooms, estimate)
    assert not shows(alone, 1.0, 1.3, look.TRUTH)


def test_the_robot_stands_where_the_track_ends() -> None:
    report, rooms = home()
    picture = picture_of_map(report, rooms, track((-0.5, 1.0), (2.5, -0.3)))
    for dx, dy in ((0.17, 0.0), (-0.17, 0.0), (0.0, 0.17), (0.08, 0.0)):  # rim and nose
        assert shows(picture, 2.5 + dx, -0.3 + dy, look.INK)
    assert not shows(picture, 2.5 - 0.08, -0.3 - 0.05, look.INK)


def test_a_landmark_has_a_dot_and_its_two_sigma_ellipse() -> None:
    cov = np.array([[[0.2**2, 0.0], [0.0, 0.05**2]]])
    report, rooms = home((np.array([[2.0, 0.6]]), cov))
    picture = picture_of_map(report, rooms, NOWHERE)
    for dx, dy in ((0.0, 0.0), (0.4, 0.0), (-0.4, 0.0), (0.0, 0.1), (0.0, -0.1)):
        assert shows(picture, 2.0 + dx, 0.6 + dy, look.LANDMARK)
    assert not shows(picture, 2.0, 0.6 + 0.4, look.LANDMARK)


def test_the_legend_names_the_truth_only_if_there_is_some() -> None:
    report, rooms = home()
    here = track((0.0, 0.0), (1.0, 1.0))
    panel = slice(46 * CELL_PX, None)

    def swatch(picture: np.ndarray) -> int:
        return int((picture[:, panel] == look.TRUTH).all(axis=2).sum())

    assert swatch(picture_of_map(report, rooms, here, here)) > 50
    assert swatch(picture_of_map(report, rooms, here)) == 0


def test_a_caption_is_written_into_the_panel() -> None:
    report, rooms = home()
    plain = picture_of_map(report, rooms, NOWHERE)
    titled = picture_of_map(report, rooms, NOWHERE, caption="covered 93.1 %")
    changed = (plain != titled).any(axis=2)
    assert changed[:, 46 * CELL_PX :].any() and not changed[:, : 46 * CELL_PX].any()


def test_an_unknown_landmark_and_an_empty_map_do_no_harm() -> None:
    unknown = (np.full((1, 2), np.nan), np.full((1, 2, 2), np.nan))
    report, rooms = home(unknown)
    assert picture_of_map(report, rooms, NOWHERE).any()
    empty = MapReport(
        0, Grid(0.05, 0.0, 0.0, np.empty((0, 0), np.int8)), np.empty((0, 0), bool), *unknown
    )
    picture = picture_of_map(empty, None, track((0.0, 0.0), (5.0, 5.0)))
    assert (picture == look.DOCK).all(axis=2).any()


def test_a_track_outside_the_grid_widens_the_picture() -> None:
    report, rooms = home()
    wide = picture_of_map(report, rooms, track((0.0, 0.0), (6.0, 0.0)))
    assert wide.shape[1] > picture_of_map(report, rooms, NOWHERE).shape[1]


@pytest.mark.parametrize("side", [2, 400, 2400])
def test_any_size_of_map_makes_a_png_of_a_sensible_size(side: int) -> None:
    cells = np.zeros((side, side), np.int8)
    png = draw_map(
        MapReport(0, Grid(0.025, 0.0, 0.0, cells), cells > 0, *NO_LANDMARKS), None, NOWHERE
    )
    picture = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)
    assert 400 <= picture.shape[0] <= 1300 and picture.shape[1] <= 1600
    assert (picture == 255).all(axis=2).sum() >= side  # free floor is white
