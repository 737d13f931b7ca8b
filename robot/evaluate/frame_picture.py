"""What perception made of one frame, as a picture: landmarks on the left image, and disparity."""

from __future__ import annotations

import cv2
import numpy as np

from robot.geometry.stereo import StereoCamera
from robot.messages import Seen

_SCALE = 2
_KINDS = {"point": (0, 200, 255), "edge": (255, 120, 40), "marker": (80, 220, 80)}  # blue first


def draw_frame(
    left: np.ndarray, disparity_px: np.ndarray, camera: StereoCamera, seen: Seen, max_px: float
) -> bytes:
    """PNG: the rectified left image (h, w) with the landmarks of `seen`, beside the disparity.

    Landmarks are amber (points), blue (edges) or green (markers), each with a one-sigma bar of
    bearing; disparity runs from blue (0) to red (`max_px`), and black is unknown.
    """
    picture = np.hstack([_landmarks(left, camera, seen), disparity_colours(disparity_px, max_px)])
    return bytes(cv2.imencode(".png", picture)[1].tobytes())


def disparity_colours(disparity_px: np.ndarray, max_px: float) -> np.ndarray:
    """Disparity (h, w) in colours, uint8 (2h, 2w, 3), blue first; NaN is black."""
    known = np.isfinite(disparity_px)
    share = np.clip(np.where(known, disparity_px, 0.0) / max_px, 0.0, 1.0)
    colours = cv2.applyColorMap((share * 255.0).astype(np.uint8), cv2.COLORMAP_TURBO)
    colours[~known] = 0
    return np.asarray(_large(colours))


def _landmarks(left: np.ndarray, camera: StereoCamera, seen: Seen) -> np.ndarray:
    picture = _large(cv2.cvtColor(left, cv2.COLOR_GRAY2BGR))
    for landmark in seen.landmarks:
        height_m = landmark.height_m if np.isfinite(landmark.height_m) else 0.0
        sigma = float(np.sqrt(max(0.0, landmark.cov[1, 1])))
        bearings = landmark.bearing_rad + np.array([-sigma, 0.0, sigma])
        points = np.column_stack(
            [
                landmark.range_m * np.cos(bearings),
                landmark.range_m * np.sin(bearings),
                np.full(3, height_m),
            ]
        )
        u, v, _ = camera.pixel_from_base(points)
        if not (np.isfinite(u).all() and np.isfinite(v).all()):
            continue
        pixels = np.column_stack([u, v]) * _SCALE + 0.5 * (_SCALE - 1)
        ends = [(round(float(x)), round(float(y))) for x, y in pixels]
        colour = _KINDS[landmark.kind]
        cv2.line(picture, ends[0], ends[2], colour, 1, cv2.LINE_AA)
        cv2.circle(picture, ends[1], 3, colour, -1, cv2.LINE_AA)
    return picture


def _large(image: np.ndarray) -> np.ndarray:
    return np.repeat(np.repeat(image, _SCALE, axis=0), _SCALE, axis=1)
