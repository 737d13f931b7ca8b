"""The contract of every matcher, and the two rules that all of them share."""

from __future__ import annotations

from typing import Protocol

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
    clean = np.where(known, disparity_px, np.float32(np.nan)).astype(np.float32)
    if confidence is None:
        trust = known.astype(np.float32)
    else:
        trust = np.where(known, np.clip(confidence, 0.0, 1.0), 0.0).astype(np.float32)
    return DisparityMap(t_ns, clean, trust)
