"""Calibration boards: chessboard and ChArUco, found in a picture or drawn for the printer."""

from __future__ import annotations

import re
from dataclasses import dataclass

import cv2
import numpy as np

from robot.errors import CalibrationError

_SPEC = re.compile(r"(chess|charuco):(\d+)x(\d+):(\d+(?:\.\d+)?)mm")
_DICTIONARY = cv2.aruco.DICT_5X5_100  # another one than the dock's marker
_MARKER_SHARE = 0.75  # of a ChArUco square
_MIN_CORNERS = 8
_SUBPIX = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 50, 1e-4)


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """Corners of one picture: their numbers on the board (n,) and pixels (n, 2) float32."""

    ids: np.ndarray
    pixel: np.ndarray


@dataclass(frozen=True, slots=True)
class Board:
    """`columns` x `rows` inner corners, `square_m` apart."""

    kind: str  # chess or charuco
    columns: int
    rows: int
    square_m: float

    def points_m(self, ids: np.ndarray | None = None) -> np.ndarray:
        """Corners (n, 3) float32 on the board's plane, all or those of `ids`."""
        grid = np.mgrid[0 : self.columns, 0 : self.rows].T.reshape(-1, 2)
        points = np.zeros((len(grid), 3), np.float32)
        points[:, :2] = grid * self.square_m
        return points if ids is None else points[ids]

    def find(self, grey: np.ndarray) -> Found | None:
        """The board in a grey picture (h, w) uint8, to a tenth of a pixel; None: not seen."""
        return self._find_chess(grey) if self.kind == "chess" else self._find_charuco(grey)

    def draw(self, pixels_per_m: float) -> np.ndarray:
        """The board as a picture uint8, a square's width of white around it."""
        square = round(self.square_m * pixels_per_m)
        squares = (self.columns + 1, self.rows + 1)
        if self.kind == "charuco":
            size = (squares[0] * square, squares[1] * square)
            inner = self._charuco().generateImage(size)
        else:
            checks = np.indices((squares[1], squares[0])).sum(axis=0) % 2
            inner = np.kron(checks * 255, np.ones((square, square))).astype(np.uint8)
        return np.pad(inner, square, constant_values=255)

    def _find_chess(self, grey: np.ndarray) -> Found | None:
        size = (self.columns, self.rows)
        flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
        seen, corners = cv2.findChessboardCorners(grey, size, flags=flags)
        if not seen:
            return None
        # The window must not reach the neighbouring corner.
        steps = np.linalg.norm(np.diff(corners.reshape(self.rows, self.columns, 2), axis=1), axis=2)
        reach = int(np.clip(steps.min() / 2.5, 2, 7))
        corners = cv2.cornerSubPix(grey, corners, (reach, reach), (-1, -1), _SUBPIX)
        return Found(np.arange(self.columns * self.rows), corners.reshape(-1, 2))

    def _find_charuco(self, grey: np.ndarray) -> Found | None:
        parameters = cv2.aruco.DetectorParameters()
        parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_NONE
        detector = cv2.aruco.CharucoDetector(
            self._charuco(), cv2.aruco.CharucoParameters(), parameters
        )
        corners, ids, _, _ = detector.detectBoard(grey)
        if ids is None or len(ids) < _MIN_CORNERS:
            return None
        order = np.argsort(ids.ravel())
        return Found(ids.ravel()[order], corners.reshape(-1, 2)[order].astype(np.float32))

    def _charuco(self) -> cv2.aruco.CharucoBoard:
        dictionary = cv2.aruco.getPredefinedDictionary(_DICTIONARY)
        marker_m = self.square_m * _MARKER_SHARE
        squares = (self.columns + 1, self.rows + 1)
        return cv2.aruco.CharucoBoard(squares, self.square_m, marker_m, dictionary)


def parse_board(text: str) -> Board:
    """`chess:9x6:25mm` or `charuco:9x6:25mm`: inner corners and size of a square."""
    match = _SPEC.fullmatch(text)
    if match is None:
        raise CalibrationError(
            f"--board '{text}' is no board; write chess:9x6:25mm or charuco:9x6:25mm, with the "
            "number of inner corners and the measured size of a square."
        )
    kind, columns, rows, size_mm = match.groups()
    board = Board(kind, int(columns), int(rows), float(size_mm) / 1000.0)
    if not (3 <= board.columns <= 20 and 3 <= board.rows <= 20 and board.square_m > 0.001):
        raise CalibrationError(
            f"--board '{text}': boards have 3 to 20 corners a side and squares of more than 1 mm; "
            "correct it."
        )
    if kind == "charuco" and (board.columns + 1) * (board.rows + 1) // 2 > 100:
        raise CalibrationError(
            f"--board '{text}': ChArUco boards have at most 200 squares; choose a smaller one."
        )
    return board
