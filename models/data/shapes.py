"""Floating shapes: layers of textured sheets, each with its own disparity field.

A sheet gives every left pixel (x, y) a disparity D(x, y); the right pixel xr sees the point whose
left column solves x = xr + D(x, y). That is found by fixed-point iteration, which converges as
the slope of D along x stays below one. Nearer sheets hide farther ones pixel by pixel.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

WIDTH, HEIGHT, MAX_DISPARITY = 320, 240, 63.0
X, Y = np.meshgrid(np.arange(WIDTH, dtype=np.float32), np.arange(HEIGHT, dtype=np.float32))
Shade = Callable[[np.ndarray, np.ndarray], np.ndarray]


def _bumps(rng: np.random.Generator, cells: int, amplitude_px: float) -> np.ndarray:
    field = rng.standard_normal((cells, cells)).astype(np.float32) * np.float32(amplitude_px)
    return cv2.resize(field, (WIDTH, HEIGHT), interpolation=cv2.INTER_CUBIC)


def _plane(rng: np.random.Generator, disparity_px: float, slope: float) -> np.ndarray:
    centre_x, centre_y = rng.uniform(0, WIDTH), rng.uniform(0, HEIGHT)
    along_x = np.clip(rng.normal(0, slope), -0.35, 0.35)
    along_y = rng.normal(0, 1.5 * slope)
    return (disparity_px + along_x * (X - centre_x) + along_y * (Y - centre_y)).astype(np.float32)


def _outline(rng: np.random.Generator) -> np.ndarray:
    """Coverage 0..1 (h, w) of a random polygon, ellipse, box or thin rod."""
    mask = np.zeros((HEIGHT, WIDTH), np.uint8)
    centre = rng.uniform(-10, WIDTH + 10), rng.uniform(-10, HEIGHT + 10)
    radius = np.exp(rng.uniform(np.log(7), np.log(95)))
    kind = rng.integers(4)
    corners: np.ndarray
    turn = float(rng.choice([0.0, 90.0, rng.uniform(0, 180)]))
    if kind == 0:
        angles = np.sort(rng.uniform(0, 2 * np.pi, int(rng.integers(3, 11))))
        reach = radius * rng.uniform(0.5, 1.2, len(angles))
        corners = np.stack([reach * np.cos(angles), reach * np.sin(angles)], 1) + centre
    elif kind == 1:
        size = radius * rng.uniform(0.3, 1.2, 2)
        angles = np.linspace(0, 2 * np.pi, 40, endpoint=False)
        c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
        a, b = size[0] * np.cos(angles), size[1] * np.sin(angles)
        corners = np.stack([c * a - s * b, s * a + c * b], 1) + centre
    else:
        size = radius * rng.uniform(0.4, 2.2, 2)
        if kind == 3:
            size = np.array([rng.uniform(1.5, 12), radius * rng.uniform(1, 4)])
        corners = np.asarray(cv2.boxPoints((centre, (float(size[0]), float(size[1])), turn)))
    points = np.round(corners * 16).astype(np.int32)
    cv2.fillPoly(mask, [points], 255, cv2.LINE_AA, 4)
    return mask.astype(np.float32) / 255


def _shade(rng: np.random.Generator, bank: np.ndarray) -> Shade:
    """A random texture at a random scale, turn and contrast, as a function of (x, y)."""
    texture = bank[int(rng.integers(len(bank)))]
    scale = np.exp(rng.uniform(np.log(0.35), np.log(1.8)))
    turn = rng.uniform(-np.pi, np.pi) if rng.random() < 0.5 else rng.uniform(-0.2, 0.2)
    c, s = np.float32(np.cos(turn) / scale), np.float32(np.sin(turn) / scale)
    offset = rng.uniform(0, texture.shape[0], 2).astype(np.float32)
    gain, bias = np.float32(rng.uniform(0.5, 1.4)), np.float32(rng.uniform(-40, 40))
    contrast = np.float32(rng.choice([1.0, 0.3, 0.12, 0.03], p=[0.76, 0.1, 0.08, 0.06]))
    if scale < 0.7:
        texture = cv2.GaussianBlur(texture, (0, 0), 0.45 / scale)

    def shade(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        u, v = c * x - s * y + offset[0], s * x + c * y + offset[1]
        grey = cv2.remap(texture, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)
        grey = (grey.astype(np.float32) - 128) * (contrast * gain) + 128 + bias
        return np.clip(grey, 0, 255)

    return shade


def _sheets(rng: np.random.Generator) -> list[tuple[np.ndarray, np.ndarray | None]]:
    """(disparity, coverage or None for everywhere), roughly from far to near."""
    scale = rng.choice([0.2, 0.4, 0.7, 1.0], p=[0.2, 0.2, 0.3, 0.3])
    far = rng.uniform(0.5, 25) * scale
    wall = _plane(rng, far, 0.02) + _bumps(
        rng, int(rng.integers(3, 7)), rng.uniform(0, 1.5) * scale
    )
    sheets: list[tuple[np.ndarray, np.ndarray | None]] = [(wall, None)]
    if rng.random() < 0.6:
        horizon, slope = rng.uniform(60, 180), rng.uniform(0.05, 0.5) * scale
        floor = (far + (Y - horizon) * slope).astype(np.float32)
        sheets.append((floor, (horizon < Y).astype(np.float32)))
    count = int(rng.integers(3, 15))
    for disparity in np.sort(rng.uniform(far, far + rng.uniform(5, 50) * scale, count)):
        field = _plane(rng, disparity, float(rng.choice([0, 0.01, 0.06, 0.15])))
        if rng.random() < 0.35:
            field = field + _bumps(rng, int(rng.integers(2, 8)), rng.uniform(0, 2) * scale)
        sheets.append((field, _outline(rng)))
    return sheets


def shapes_pair(
    rng: np.random.Generator, bank: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Clean left and right images and the left's disparity, float32 (240, 320) each."""
    left, right = np.zeros((HEIGHT, WIDTH), np.float32), np.zeros((HEIGHT, WIDTH), np.float32)
    near_left = np.full((HEIGHT, WIDTH), -1.0, np.float32)
    near_right = near_left.copy()
    for raw, coverage in _sheets(rng):
        field = np.clip(raw, 0.2, MAX_DISPARITY).astype(np.float32)
        shade = _shade(rng, bank)
        alpha = np.ones_like(field) if coverage is None else coverage
        seen = alpha * (field >= near_left)
        left = left * (1 - seen) + shade(X, Y) * seen
        near_left = np.where(seen > 0.5, field, near_left)
        column = X + field
        for _ in range(5):
            column = X + cv2.remap(field, column, Y, cv2.INTER_LINEAR, None, cv2.BORDER_REPLICATE)
        there = column - X
        if coverage is not None:
            alpha = cv2.remap(coverage, column, Y, cv2.INTER_LINEAR, None, cv2.BORDER_REPLICATE)
        seen = alpha * (there >= near_right)
        right = right * (1 - seen) + shade(column, Y) * seen
        near_right = np.where(seen > 0.5, there, near_right)
    return left, right, near_left
