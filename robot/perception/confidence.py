"""Which disparities to believe: what cannot be known becomes NaN.

Four cheap tests, none of which needs a second match:

- *seen by both*: the match must lie inside the right image;
- *unique*: where two pixels claim one place of the right image, the nearer one hides the other
  (the left-right check, from one side only);
- *texture*: a window without horizontal gradient above the sensor's noise says nothing about
  disparity, and there matchers invent obstacles on plain walls;
- *likeness*: the right image, shifted by the disparity, must look like the left one up to what
  noise and a fraction of a pixel explain.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from robot.config import PerceptionConfig
from robot.geometry.stereo import StereoCamera
from robot.messages import DisparityMap

UNIQUE_PX = 1.0
TEXTURE_WINDOW = (7, 7)
LIKENESS_WINDOW = (5, 5)
TEXTURE_OVER_NOISE = 1.3  # energy of the horizontal gradient, times what noise alone gives
LIKENESS_PX = 0.7  # mean difference allowed, in pixels of shift along the local gradient


@dataclass(frozen=True, slots=True, eq=False)
class Trusted:
    """Disparity (h, w) with NaN where it is not believed, and the believed share of the image."""

    disparity_px: np.ndarray
    share: float


class Confidence:
    """The tests, with their tables for one camera."""

    def __init__(self, config: PerceptionConfig, camera: StereoCamera) -> None:
        self._config = config
        rows, columns = np.mgrid[0 : camera.height_px, 0 : camera.width_px]
        self._u = columns.astype(np.float32)
        self._v = rows.astype(np.float32)
        self._row_start = (rows * camera.width_px).astype(np.int32)

    def check(self, left: np.ndarray, right: np.ndarray, found: DisparityMap) -> Trusted:
        """Keep what passes all tests; images are rectified and of equal exposure."""
        known = found.confidence >= max(self._config.min_confidence, 1e-6)
        disparity = np.where(known, found.disparity_px, np.float32(0.0))
        seen = self._u - disparity
        known &= self._unique(seen, disparity, known)
        known &= self._alike(left, right, seen)
        trusted = np.where(known, found.disparity_px, np.float32(np.nan))
        return Trusted(trusted, float(np.count_nonzero(known)) / known.size)

    def _unique(self, seen: np.ndarray, disparity: np.ndarray, known: np.ndarray) -> np.ndarray:
        inside = known & (seen > -0.5)
        # Pixels outside write a disparity of 0 to their own place, which hides nothing.
        target = self._row_start + np.rint(np.where(inside, seen, self._u)).astype(np.int32)
        claims = np.where(inside, disparity, np.float32(0.0))
        nearest = np.zeros(disparity.size, np.float32)
        np.maximum.at(nearest, target.ravel(), claims.ravel())
        return inside & (nearest[target] - disparity <= UNIQUE_PX)

    def _alike(self, left: np.ndarray, right: np.ndarray, seen: np.ndarray) -> np.ndarray:
        noise = self._config.image_noise
        gradient = cv2.Sobel(left, cv2.CV_32F, 1, 0, ksize=1)  # difference of the two neighbours
        energy = cv2.blur(cv2.multiply(gradient, gradient), TEXTURE_WINDOW)
        moved = cv2.remap(right, seen, self._v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        difference = cv2.boxFilter(cv2.absdiff(left, moved), cv2.CV_32F, LIKENESS_WINDOW)
        from_noise = 2.0 * noise**2
        slope = np.sqrt(np.maximum(energy - np.float32(from_noise), 0.0)) * np.float32(0.5)
        allowed = slope * np.float32(LIKENESS_PX) + np.float32(LIKENESS_PX + noise)
        return (energy > TEXTURE_OVER_NOISE * from_noise) & (difference < allowed)


def match_exposure(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """The right image with mean and standard deviation of the left one (grey uint8)."""
    left_mean, left_sigma = (float(x[0, 0]) for x in cv2.meanStdDev(left))
    right_mean, right_sigma = (float(x[0, 0]) for x in cv2.meanStdDev(right))
    gain = min(max(left_sigma / max(right_sigma, 1.0), 0.5), 2.0)
    table = np.arange(256) * gain + (left_mean - gain * right_mean)
    return cv2.LUT(right, np.clip(np.rint(table), 0, 255).astype(np.uint8))
