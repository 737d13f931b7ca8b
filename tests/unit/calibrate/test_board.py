"""Boards are found where they are, to a fraction of a pixel."""

import numpy as np
import pytest
from board_pictures import board_poses, picture, project

from robot.calibrate.board import Board, parse_board
from robot.errors import CalibrationError


@pytest.mark.parametrize("text", ["chess:8x6:24mm", "charuco:8x6:24mm"])
def test_corners_are_found_to_a_tenth_of_a_pixel(text):
    board = parse_board(text)
    errors = []
    for rotation, move in board_poses(3, board, np.random.default_rng(3)):
        found = board.find(picture(board, rotation, move, right=False))
        assert found is not None and len(found.ids) >= 0.9 * 48
        truth = project(board.points_m(found.ids), rotation, move, right=False)
        errors.append(np.linalg.norm(found.pixel - truth, axis=1))
    assert np.concatenate(errors).mean() < 0.12


def test_a_charuco_board_may_leave_the_picture_and_keeps_its_numbers():
    board = parse_board("charuco:8x6:24mm")
    rotation, move = next(board_poses(1, board, np.random.default_rng(1)))
    image = picture(board, rotation, move, right=False)
    image[:, 240:] = 128
    found = board.find(image)
    assert 8 <= len(found.ids) < 40
    truth = project(board.points_m(found.ids), rotation, move, right=False)
    assert np.abs(found.pixel - truth).max() < 0.6


@pytest.mark.parametrize("kind", ["chess", "charuco"])
def test_no_board_is_found_where_none_is(kind):
    noise = np.random.default_rng(1).integers(0, 255, (240, 320), dtype=np.uint8)
    assert Board(kind, 8, 6, 0.024).find(noise) is None


@pytest.mark.parametrize(
    "text",
    ["", "chess", "chess:9x6", "circles:9x6:20mm", "chess:2x6:20mm", "chess:9x6:0.5mm",
     "charuco:20x20:10mm", "chess:9x6:25mm "],
)  # fmt: skip
def test_a_board_that_cannot_be_is_explained(text):
    with pytest.raises(CalibrationError, match="--board"):
        parse_board(text)
