"""A picture of a map: landmarks with their ellipses, the estimated track, the true one."""

from __future__ import annotations

import cv2
import numpy as np

from robot.evaluate.canvas import Canvas
from robot.evaluate.trajectory import align, associate

_PAPER, _TRUE, _TRACK, _MARK = (250, 250, 248), (150, 150, 150), (200, 60, 40), (30, 90, 170)
_SIZE_PX = 900
_SIGMAS = 3.0


def draw_map(
    track: np.ndarray, truth: np.ndarray, landmarks: np.ndarray, covs: np.ndarray
) -> bytes:
    """PNG of a track (n, 4), the truth (k, 4) aligned to it, and landmarks with 3-sigma ellipses.

    `landmarks` is (m, 2), `covs` (m, 2, 2).
    """
    true = _onto(track, truth)
    everything = np.vstack([track[:, 1:3], true, landmarks, np.zeros((1, 2))])
    low, high = everything.min(axis=0) - 0.5, everything.max(axis=0) + 0.5
    cell_m = float((high - low).max()) / _SIZE_PX
    columns, rows = np.ceil((high - low) / cell_m).astype(int).tolist()
    origin = float(low[0]), float(low[1])
    canvas = Canvas((rows, columns), cell_m, origin, 1.0, (220, 160), _PAPER)
    canvas.polyline(true, _TRUE, 2.0)
    canvas.polyline(track[:, 1:3], _TRACK, 1.5)
    for place, cov in zip(landmarks, covs, strict=True):
        canvas.polyline(_ellipse(place, cov), _MARK, 1.0, closed=True)
        canvas.disc(place, 2.5, _MARK)
    words = (
        (f"{len(landmarks)} landmarks, 3 sigma", _MARK),
        ("estimated track", _TRACK),
        ("true track, aligned", _TRUE),
        (f"{float((high - low)[0]):.1f} m wide", (60, 60, 60)),
    )
    for i, (text, colour) in enumerate(words):
        canvas.text_px(text, (canvas.map_width_px + 12, 30 + 26 * i), colour)
    encoded, data = cv2.imencode(".png", canvas.finished()[:, :, ::-1])
    assert encoded
    return data.tobytes()


def _onto(track: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """The truth's positions, moved onto the track."""
    estimate, partner = associate(track, truth)
    if len(estimate) < 2:
        return truth[:, 1:3] if len(truth) else np.empty((0, 2))
    moved: np.ndarray = align(partner[:, 1:3], estimate[:, 1:3]).apply(truth[:, 1:3])
    return moved


def _ellipse(place: np.ndarray, cov: np.ndarray) -> np.ndarray:
    values, vectors = np.linalg.eigh(cov)
    angle = np.linspace(0.0, 2.0 * np.pi, 33)
    circle = np.stack([np.cos(angle), np.sin(angle)]) * np.sqrt(np.maximum(values, 0.0))[:, None]
    return np.asarray(place + _SIGMAS * (vectors @ circle).T)
