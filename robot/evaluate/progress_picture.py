"""Covered floor over time, one line a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np

WIDTH_PX, HEIGHT_PX, LEFT_PX, TOP_PX, RIGHT_PX, BOTTOM_PX = 1100, 600, 60, 40, 240, 50
INK, GRID = (70, 60, 50), (225, 220, 215)  # blue first
MAX_NAMES = 24


def draw_progress(path: Path, curves: Mapping[str, Sequence[tuple[float, float]]]) -> None:
    """Write a PNG of curves of (t_s, covered_pct), named at the right."""
    picture = np.full((HEIGHT_PX, WIDTH_PX, 3), 255, np.uint8)
    longest_s = max((curve[-1][0] for curve in curves.values() if curve), default=60.0)
    minutes = max(1, int(np.ceil(longest_s / 60.0)))
    wide, high = WIDTH_PX - LEFT_PX - RIGHT_PX, HEIGHT_PX - TOP_PX - BOTTOM_PX

    def place(t_s: float, pct: float) -> tuple[int, int]:
        x = LEFT_PX + wide * t_s / (60.0 * minutes)
        return round(x), round(TOP_PX + high * (1.0 - pct / 100.0))

    for pct in range(0, 101, 20):
        cv2.line(picture, place(0.0, pct), place(60.0 * minutes, pct), GRID, 1)
        _text(picture, f"{pct} %", (8, place(0.0, pct)[1] + 5))
    every = max(1, minutes // 10)
    for minute in range(0, minutes + 1, every):
        cv2.line(picture, place(60.0 * minute, 0.0), place(60.0 * minute, 100.0), GRID, 1)
        x, y = place(60.0 * minute, 0.0)
        _text(picture, f"{minute}", (x - 6, y + 22))
    _text(picture, "minutes", (LEFT_PX + wide // 2 - 30, HEIGHT_PX - 8))
    _text(picture, "covered floor", (LEFT_PX, TOP_PX - 14))
    for number, (name, curve) in enumerate(curves.items()):
        colour = _colour(number, len(curves))
        points = np.array([place(*point) for point in curve]).reshape(-1, 1, 2)
        if len(points) > 1:
            cv2.polylines(picture, [points], False, colour, 2, cv2.LINE_AA)
        if number < MAX_NAMES:
            y = TOP_PX + 12 + 20 * number
            cv2.line(picture, (WIDTH_PX - 220, y - 5), (WIDTH_PX - 195, y - 5), colour, 3)
            _text(picture, name[-24:], (WIDTH_PX - 188, y))
    cv2.imwrite(str(path), picture)


def _text(picture: np.ndarray, words: str, place: tuple[int, int]) -> None:
    cv2.putText(picture, words, place, cv2.FONT_HERSHEY_SIMPLEX, 0.48, INK, 1, cv2.LINE_AA)


def _colour(number: int, count: int) -> tuple[float, ...]:
    hue = np.array([[[int(179 * number / max(count, 1)), 190, 190]]], np.uint8)
    return tuple(float(v) for v in cv2.cvtColor(hue, cv2.COLOR_HSV2BGR)[0, 0])
