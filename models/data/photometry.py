"""What two real cameras do to the same scene: applied differently to each eye."""

from __future__ import annotations

import cv2
import numpy as np


def _misalign(rng: np.random.Generator, image: np.ndarray) -> np.ndarray:
    """Shift by up to +-1 px vertically with a slight roll, as after an imperfect calibration."""
    height, width = image.shape
    roll = rng.normal(0, 0.0012)
    shift = rng.uniform(-1, 1) if rng.random() < 0.5 else 0.0
    # x stays untouched: the true disparity must not change.
    matrix = np.array([[1, 0, 0], [roll, 1, shift - roll * width / 2]], np.float32)
    return cv2.warpAffine(
        image, matrix, (width, height), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )


def _vignette(rng: np.random.Generator, height: int, width: int) -> np.ndarray:
    y, x = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]
    return (1 - rng.uniform(0, 0.25) * (x**2 + y**2) / 2).astype(np.float32)


def _gloss(rng: np.random.Generator, left: np.ndarray, right: np.ndarray) -> None:
    """Add a few soft reflections, each with a disparity of its own, to both eyes in place."""
    height, width = left.shape
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    for _ in range(int(rng.integers(1, 4))):
        u, v, disparity = rng.uniform(0, width), rng.uniform(0, height), rng.uniform(0, 20)
        wide, high = rng.uniform(3, 25, 2)
        strength = np.float32(rng.uniform(15, 90))
        for image, column in ((left, u), (right, u - disparity)):
            spot = np.exp(-0.5 * (((x - column) / wide) ** 2 + ((y - v) / high) ** 2))
            image += strength * spot.astype(np.float32)


def photograph(
    rng: np.random.Generator, left: np.ndarray, right: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Turn two clean grey images (h, w), 0 to 255, into uint8 exposures of two cameras.

    Some get reflections. Blur, exposure, offset, gamma and noise share a common part and differ a
    little; only the right eye is misaligned, so that the disparity stays that of the left.
    """
    left, right = left.astype(np.float32), right.astype(np.float32)
    if rng.random() < 0.15:
        _gloss(rng, left, right)
    blur = rng.uniform(0, 0.9)
    noise = np.exp(rng.uniform(np.log(0.3), np.log(5.0)))
    differs = 0.4 if rng.random() < 0.4 else 1.6 if rng.random() < 0.3 else 1.0
    eyes = []
    for index, image in enumerate((left, right)):
        grey = _misalign(rng, image) if index == 1 else image
        sigma = blur + rng.normal(0, 0.1)
        if sigma > 0.3:
            grey = cv2.GaussianBlur(grey, (0, 0), sigma)
        if rng.random() < 0.3:
            grey = grey * _vignette(rng, *grey.shape)
        gamma = np.exp(rng.normal(0, 0.06 * differs))
        grey = 255 * (np.clip(grey, 0, 255) / 255) ** np.float32(gamma)
        grey = grey * np.float32(np.exp(rng.normal(0, 0.06 * differs)))
        grey = grey + np.float32(rng.normal(0, 4 * differs))
        grain = rng.standard_normal(grey.shape, dtype=np.float32)
        # Shot noise grows with the root of the light; the floor is the sensor's own.
        grey += grain * np.float32(noise) * np.sqrt(0.3 + np.clip(grey, 0, 255) / 182)
        eyes.append(np.clip(np.rint(grey), 0, 255).astype(np.uint8))
    return eyes[0], eyes[1]
