"""Sharpening the outline of a small dark square on light ground.

A marker far away is a dozen pixels wide; corner refinement sees its inner pattern and pulls the
corners inwards. The four sides are longer than the corners are sharp: each side is placed where
the brightness across it changes fastest, and the corners are where the sides meet.
"""

from __future__ import annotations

import cv2
import numpy as np

SAMPLES = 12  # along a side
INSET = 0.12  # of a side that is left out at both ends
REACH_PX = 2.0  # looked at across a side, at least ...
REACH_SHARE = 0.06  # ... or so much of its length
STEPS = 17
ROUNDS = 3


def sharpen_quad(image: np.ndarray, quad: np.ndarray) -> np.ndarray:
    """Corners (4, 2) of a dark quadrilateral, in order, refined from a rough (4, 2).

    Returns the rough corners where no outline is found.
    """
    refined = quad
    for _ in range(ROUNDS):
        sides = _sides(image, refined)
        if sides is None:
            return quad
        point, along = sides
        refined = _meet(point, along)
        if not np.all(np.isfinite(refined)) or np.abs(refined - quad).max() > 2.5 * REACH_PX:
            return quad
    return refined


def _sides(image: np.ndarray, quad: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """A point (4, 2) and a direction (4, 2) of every side; None if one has no contrast."""
    along = np.roll(quad, -1, axis=0) - quad
    length = np.linalg.norm(along, axis=1)
    if length.min() < 4.0:
        return None
    outward = np.stack([along[:, 1], -along[:, 0]], axis=1) / length[:, None]
    inside = (quad.mean(axis=0) - quad) * outward
    outward *= -np.sign(inside.sum(axis=1))[:, None]
    share = np.linspace(INSET, 1.0 - INSET, SAMPLES)
    reach = np.maximum(REACH_PX, REACH_SHARE * length)
    across = np.linspace(-1.0, 1.0, STEPS)[None] * reach[:, None]  # (4, steps)
    base = quad[:, None] + share[None, :, None] * along[:, None]  # (4, samples, 2)
    place = base[:, :, None] + across[:, None, :, None] * outward[:, None, None]
    flat = place.reshape(4 * SAMPLES, STEPS, 2).astype(np.float32)
    profile = cv2.remap(
        image, flat[..., 0], flat[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    ).reshape(4, SAMPLES, STEPS)
    rise = np.maximum(np.diff(profile.astype(np.float64), axis=2), 0.0)
    middle = 0.5 * (across[:, 1:] + across[:, :-1])
    weight = rise**2  # the steepest part decides
    total = weight.sum(axis=2)
    if total.sum(axis=1).min() <= 1.0:
        return None
    offset = (weight * middle[:, None]).sum(axis=2) / np.maximum(total, 1e-9)
    # Weighted straight line of offset over the share of the side.
    w = total / total.sum(axis=1, keepdims=True)
    mean_s = (w * share).sum(axis=1)
    mean_o = (w * offset).sum(axis=1)
    ds, do = share[None] - mean_s[:, None], offset - mean_o[:, None]
    tilt = (w * ds * do).sum(axis=1) / np.maximum((w * ds * ds).sum(axis=1), 1e-9)
    point = quad + mean_s[:, None] * along + mean_o[:, None] * outward
    return point, along + tilt[:, None] * outward


def _meet(point: np.ndarray, along: np.ndarray) -> np.ndarray:
    """Corners (4, 2): every side's start, where it meets the side before."""
    before_point, before_along = np.roll(point, 1, axis=0), np.roll(along, 1, axis=0)
    cross = before_along[:, 0] * along[:, 1] - before_along[:, 1] * along[:, 0]
    apart = point - before_point
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (apart[:, 0] * along[:, 1] - apart[:, 1] * along[:, 0]) / cross
    return before_point + t[:, None] * before_along
