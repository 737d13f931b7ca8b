"""A sheet of paper in world coordinates: x to the right, y up, drawn with OpenCV.

Everything is drawn at twice its final size and averaged down at the end, so that lines and letters
come out smooth. Colours are (red, green, blue).
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

SUPERSAMPLING = 2
_SHIFT = 4  # fractional bits of OpenCV's drawing coordinates
_AROUND = [(dx, dy) for dx in (-3, 0, 3) for dy in (-3, 0, 3) if dx or dy]
_FONT = cv2.FONT_HERSHEY_SIMPLEX

Colour = tuple[int, int, int]


class Canvas:
    """Raster of `shape` cells of `cell_px` final pixels, with a panel at the right.

    The outer corner of cell (0, 0) lies at `origin_m`. `panel_px` is the panel's width and least
    height; a lower map stands at the bottom of it.
    """

    def __init__(
        self,
        shape: tuple[int, int],
        resolution_m: float,
        origin_m: tuple[float, float],
        cell_px: float,
        panel_px: tuple[int, int],
        paper: Colour,
    ) -> None:
        rows, columns = shape
        self._cell = max(1, round(cell_px * SUPERSAMPLING))
        self._origin_m = origin_m
        self._px_per_m = self._cell / resolution_m
        self.map_width_px = columns * self._cell / SUPERSAMPLING
        height = max(rows * self._cell, panel_px[1] * SUPERSAMPLING)
        self.height_px = height / SUPERSAMPLING
        width = columns * self._cell + panel_px[0] * SUPERSAMPLING
        self._image = np.full((height, width, 3), paper, np.uint8)

    def paint_cells(self, colours: np.ndarray) -> None:
        """Fill the map with colours (rows, columns, 3); row 0 is at the bottom."""
        large = np.repeat(np.repeat(colours[::-1], self._cell, axis=0), self._cell, axis=1)
        self._image[-large.shape[0] :, : large.shape[1]] = large

    def polyline(
        self,
        points_m: np.ndarray,
        colour: Colour,
        width_px: float,
        *,
        opacity: float = 1.0,
        closed: bool = False,
    ) -> None:
        """Lines through points (n, 2)."""
        if len(points_m) < 2:
            return
        target = self._image.copy() if opacity < 1.0 else self._image
        path = self._fixed(points_m).reshape(-1, 1, 2)
        cv2.polylines(
            target, [path], closed, colour, self._thick(width_px), cv2.LINE_AA, shift=_SHIFT
        )
        if target is not self._image:
            cv2.addWeighted(target, opacity, self._image, 1.0 - opacity, 0.0, dst=self._image)

    def polygon(self, points_m: np.ndarray, colour: Colour) -> None:
        """A filled convex polygon of points (n, 2)."""
        cv2.fillConvexPoly(self._image, self._fixed(points_m), colour, cv2.LINE_AA, shift=_SHIFT)

    def disc(self, centre_m: Sequence[float], radius_px: float, colour: Colour) -> None:
        """A filled disc of a size on paper."""
        x, y = (int(v) for v in self._fixed(np.asarray([centre_m]))[0])
        radius = int(radius_px * SUPERSAMPLING * (1 << _SHIFT))
        cv2.circle(self._image, (x, y), radius, colour, -1, cv2.LINE_AA, shift=_SHIFT)

    def rectangle_px(self, corner: Sequence[float], size: Sequence[float], colour: Colour) -> None:
        """A filled rectangle in pixels of the paper, from its upper left corner."""
        x, y = (round(v * SUPERSAMPLING) for v in corner)
        w, h = (round(v * SUPERSAMPLING) for v in size)
        self._image[y : y + h, x : x + w] = colour

    def text_px(
        self,
        words: str,
        place: Sequence[float],
        colour: Colour,
        *,
        size_px: float = 14.0,
        centred: bool = False,
        halo: Colour | None = None,
    ) -> None:
        """Words whose baseline starts (or is centred) at a place on the paper."""
        scale = size_px * SUPERSAMPLING / 30.0
        x, y = (round(v * SUPERSAMPLING) for v in place)
        if centred:
            x -= cv2.getTextSize(words, _FONT, scale, 2)[0][0] // 2
        if halo is not None:
            for dx, dy in _AROUND:
                place_px = (x + dx, y + dy)
                cv2.putText(self._image, words, place_px, _FONT, scale, halo, 2, cv2.LINE_AA)
        cv2.putText(self._image, words, (x, y), _FONT, scale, colour, 2, cv2.LINE_AA)

    def px_from_m(self, point_m: Sequence[float]) -> tuple[float, float]:
        """Where a point of the world lies on the final paper."""
        x, y = self._place(np.asarray([point_m], dtype=float))[0]
        return float((x + 0.5) / SUPERSAMPLING - 0.5), float((y + 0.5) / SUPERSAMPLING - 0.5)

    def length_px(self, length_m: float) -> float:
        """How long a distance is on the final paper."""
        return length_m * self._px_per_m / SUPERSAMPLING

    def finished(self) -> np.ndarray:
        """The picture, uint8 (h, w, 3), red first."""
        height, width = (n // SUPERSAMPLING for n in self._image.shape[:2])
        return np.asarray(cv2.resize(self._image, (width, height), interpolation=cv2.INTER_AREA))

    def _place(self, points_m: np.ndarray) -> np.ndarray:
        x = (points_m[:, 0] - self._origin_m[0]) * self._px_per_m - 0.5
        y = self._image.shape[0] - 0.5 - (points_m[:, 1] - self._origin_m[1]) * self._px_per_m
        return np.column_stack([x, y])

    def _fixed(self, points_m: np.ndarray) -> np.ndarray:
        return np.asarray(np.round(self._place(points_m) * (1 << _SHIFT)), dtype=np.int32)

    @staticmethod
    def _thick(width_px: float) -> int:
        return max(1, round(width_px * SUPERSAMPLING))
