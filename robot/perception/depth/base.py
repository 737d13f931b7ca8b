"""The contract of every matcher, and the two rules that all of them share."""

from __future__ import annotations

from typing import Protocol

import cv2
import numpy as np

from robot.errors import FrameError
from robot.geometry.stereo import StereoCamera
from robot.messages import DisparityMap


class Depth(Protocol):
    """A matcher for pairs of one camera."""

    def match(
        self,
        left: np.ndarray,
        right: np.ndarray,
        *,
        t_ns: int = 0,
        given: np.ndarray | None = None,
    ) -> DisparityMap:
        """Disparity of the left image, as float32 (h, w) in pixels; NaN where unknown, never <= 0.

        `left` and `right` are rectified grey uint8 (h, w) of the camera's size. `given` is the
        true disparity of a simulator; only the matcher "given" uses it. Raises FrameError for
        images of another size.
        """


def check_pair(camera: StereoCamera, left: np.ndarray, right: np.ndarray) -> None:
    """Raise FrameError unless both images are grey uint8 of the camera's size."""
    size = (camera.height_px, camera.width_px)
    for side, image in (("left", left), ("right", right)):
        if image.shape != size or image.dtype != np.uint8:
            shape = "x".join(map(str, image.shape[::-1]))
            raise FrameError(
                f"the {side} image is {shape} {image.dtype} where {size[1]}x{size[0]} uint8 is "
                "expected; check camera.width_px, camera.height_px and the calibration."
            )


def disparity_map(
    t_ns: int, disparity_px: np.ndarray, max_disparity_px: float, confidence: np.ndarray | None
) -> DisparityMap:
    """A map that keeps the contract: outside (0, max] there is no disparity and no confidence."""
    with np.errstate(invalid="ignore"):
        known = (disparity_px > 0.0) & (disparity_px <= max_disparity_px)
    if confidence is None:
        trust = known.astype(np.float32)
    else:
        trust = only(np.clip(confidence, 0.0, 1.0), known, 0.0)
    return DisparityMap(t_ns, only(disparity_px, known, np.nan), trust)


def only(values: np.ndarray, mask: np.ndarray, other: float) -> np.ndarray:
    """`values` as float32 where the mask is set, `other` elsewhere; cheaper than `numpy.where`."""
    values = np.ascontiguousarray(values, np.float32)
    mask = np.ascontiguousarray(mask).view(np.uint8)
    return cv2.copyTo(values, mask, np.full(values.shape, other, np.float32))
