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
from robot.perception.depth.base import only

ROW_PX = 2  # every second row is tested, and answers for the next
UNIQUE_PX = 1.0
TEXTURE_WINDOW = (7, 3)  # columns, and rows of those tested
LIKENESS_WINDOW = (5, 3)
TEXTURE_OVER_NOISE = 8.0  # energy of the horizontal gradient beyond the noise's own
ALIKE_U_PX, ALIKE_V_PX = 0.5, 0.25  # shift allowed along the columns' and the rows' gradient ...
ALIKE_GREY = 1.2  # ... and difference in brightness, beside the noise
SURFACE_STEP_PX = 2  # between the columns that surfaces are grown over; the rows are as far apart
SURFACE_PIXELS = 250
SURFACE_RISE = 32  # sixteenths of a disparity between neighbours; rows of floor differ by 21


@dataclass(frozen=True, slots=True, eq=False)
class Trusted:
    """Disparity (h, w) with NaN where it is not believed, and the believed share of the image."""

    disparity_px: np.ndarray
    share: float


class Confidence:
    """The tests, with their tables for one camera."""

    def __init__(self, config: PerceptionConfig, camera: StereoCamera) -> None:
        self._config = config
        rows, columns = np.mgrid[0 : camera.height_px : ROW_PX, 0 : camera.width_px]
        self._u = columns.astype(np.float32)
        self._v = rows.astype(np.float32)
        self._row_start = np.arange(rows.size, step=camera.width_px, dtype=np.float32)[:, None]

    def check(self, left: np.ndarray, right: np.ndarray, found: DisparityMap) -> Trusted:
        """Keep what passes all tests; images are rectified and of equal exposure."""
        answered = found.confidence >= max(self._config.min_confidence, 1e-6)
        disparity = only(found.disparity_px[::ROW_PX], answered[::ROW_PX], 0.0)
        seen = self._u - disparity
        energy_u, energy_v = self._energies(left)
        passed = self._unique(seen, disparity)
        passed &= self._alike(left, right, seen, energy_u, energy_v)
        passed &= self._founded(energy_u, disparity)
        known = answered & np.repeat(passed, ROW_PX, axis=0)[: len(answered)]
        trusted = only(found.disparity_px, known, np.nan)
        return Trusted(trusted, float(np.count_nonzero(known)) / known.size)

    def _unique(self, seen: np.ndarray, disparity: np.ndarray) -> np.ndarray:
        """Whether a pixel lies in the right image, and nothing nearer claims its place there."""
        target = (self._row_start + np.rint(_positive(seen))).astype(np.intp)
        nearest = np.empty(disparity.size, np.float32)
        # Of pixels with one target the last in a row is the nearest, and the last is what stays.
        nearest[target.ravel()] = disparity.ravel()
        return (seen > -0.5) & (nearest.take(target) - disparity <= UNIQUE_PX)

    def _alike(
        self,
        left: np.ndarray,
        right: np.ndarray,
        seen: np.ndarray,
        energy_u: np.ndarray,
        energy_v: np.ndarray,
    ) -> np.ndarray:
        """Whether the shifted right image looks like the left one."""
        moved = cv2.remap(right, seen, self._v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        difference = cv2.absdiff(left[::ROW_PX], moved)
        difference = cv2.boxFilter(difference, cv2.CV_32F, LIKENESS_WINDOW)
        allowed = ALIKE_U_PX * np.sqrt(energy_u) + ALIKE_V_PX * np.sqrt(energy_v)
        return difference < allowed + np.float32(ALIKE_GREY + self._config.image_noise)

    def _founded(self, energy_u: np.ndarray, disparity: np.ndarray) -> np.ndarray:
        """Whether there is texture, or a large smooth surface that its rim holds in place."""
        noise_energy = 0.5 * self._config.image_noise**2
        textured = energy_u > np.float32(TEXTURE_OVER_NOISE * noise_energy)
        surface = (disparity[:, ::SURFACE_STEP_PX] * np.float32(16.0)).astype(np.int16)
        least = SURFACE_PIXELS // (ROW_PX * SURFACE_STEP_PX)
        cv2.filterSpeckles(surface, 0, least, SURFACE_RISE)
        wide = (surface.shape[1] * SURFACE_STEP_PX, len(surface))
        large = cv2.resize((surface > 0).view(np.uint8), wide, interpolation=cv2.INTER_NEAREST)
        return textured | large[:, : disparity.shape[1]].view(bool)

    def _energies(self, image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean squared gradient along the columns and along the rows, in (grey per px)^2.

        What the noise adds is taken off. For every second row; central differences of uint8.
        """
        tested, between = image[::ROW_PX], image[1::ROW_PX]
        step_u, step_v = np.zeros((2, *tested.shape), np.uint8)
        step_u[:, 1:-1] = cv2.absdiff(tested[:, 2:], tested[:, :-2])
        step_v[1 : len(between)] = cv2.absdiff(between[1:], between[:-1])
        noise_energy = np.float32(0.5 * self._config.image_noise**2)
        energy_u, energy_v = (
            0.25 * cv2.sqrBoxFilter(step, cv2.CV_32F, TEXTURE_WINDOW) - noise_energy
            for step in (step_u, step_v)
        )
        return _positive(energy_u), _positive(energy_v)


def _positive(values: np.ndarray) -> np.ndarray:
    """Values (h, w) float32, 0 instead of negative ones; cheaper than `numpy.maximum`."""
    return cv2.threshold(values, 0.0, 0.0, cv2.THRESH_TOZERO)[1]
