"""Which disparities to believe: what cannot be known becomes NaN.

Four cheap tests, none of which needs a second match:

- *seen by both*: the match must lie inside the right image;
- *unique*: where two pixels claim one place of the right image, the nearer one hides the other
  (the left-right check, from one side only);
- *likeness*: the right image, shifted by the disparity, must look like the left one up to what
  noise and a fraction of a pixel explain;
- *foundation*: a window without horizontal gradient above the sensor's noise says nothing about
  disparity, and there matchers invent obstacles on plain walls. What stands there is believed only
  as part of a large smooth surface, which is held by texture elsewhere.
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
TEXTURE_OVER_NOISE = 8.0  # energy of the horizontal gradient beyond the noise's own
ALIKE_U_PX, ALIKE_V_PX = 0.5, 0.25  # shift allowed along the columns' and the rows' gradient ...
ALIKE_GREY = 1.2  # ... and difference in brightness, beside the noise
SURFACE_PIXELS = 250
SURFACE_STEP = 16  # sixteenths of a pixel between neighbours of one surface


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
        known &= self._founded(left, disparity)
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
        """Whether the shifted right image looks like the left one."""
        moved = cv2.remap(right, seen, self._v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        difference = cv2.boxFilter(cv2.absdiff(left, moved), cv2.CV_32F, LIKENESS_WINDOW)
        allowed = ALIKE_U_PX * np.sqrt(self._energy(left, 1, 0))
        allowed += ALIKE_V_PX * np.sqrt(self._energy(left, 0, 1))
        return difference < allowed + np.float32(ALIKE_GREY + self._config.image_noise)

    def _founded(self, left: np.ndarray, disparity: np.ndarray) -> np.ndarray:
        """Whether there is texture, or a large smooth surface that its rim holds in place."""
        noise_energy = 0.5 * self._config.image_noise**2
        textured = self._energy(left, 1, 0) > np.float32(TEXTURE_OVER_NOISE * noise_energy)
        surface = (disparity * np.float32(16.0)).astype(np.int16)
        cv2.filterSpeckles(surface, 0, SURFACE_PIXELS, SURFACE_STEP)
        return textured | (surface > 0)

    def _energy(self, image: np.ndarray, dx: int, dy: int) -> np.ndarray:
        """Mean squared gradient (h, w) along one axis beyond the noise's, in (grey per px)^2."""
        gradient = cv2.Sobel(image, cv2.CV_32F, dx, dy, ksize=1, scale=0.5)
        energy = cv2.sqrBoxFilter(gradient, cv2.CV_32F, TEXTURE_WINDOW)
        return np.maximum(energy - np.float32(0.5 * self._config.image_noise**2), np.float32(0.0))
