"""Semi-global matching (Hirschmueller, IEEE PAMI 2008) as OpenCV implements it."""

from __future__ import annotations

import cv2
import numpy as np

from robot.geometry.stereo import StereoCamera
from robot.messages import DisparityMap
from robot.perception.depth.base import check_pair, disparity_map

BLOCK_PX = 3
_SCALE = np.float32(1.0 / 16.0)  # OpenCV's fixed point


class SgbmDepth:
    """Three-path SGBM with a small block, on pairs padded at the left.

    OpenCV leaves the first `max_disparity_px` columns empty; as many replicated columns move that
    strip out of the image. Only the first `rows` are matched, if that is given.
    """

    def __init__(
        self, camera: StereoCamera, max_disparity_px: int, rows: int | None = None
    ) -> None:
        self._camera, self._max_px = camera, max_disparity_px
        self._rows = camera.height_px if rows is None else rows
        self._engine = cv2.StereoSGBM.create(
            minDisparity=0,
            numDisparities=max_disparity_px,
            blockSize=BLOCK_PX,
            P1=4 * BLOCK_PX**2,
            P2=16 * BLOCK_PX**2,
            preFilterCap=31,
            uniquenessRatio=10,
            speckleWindowSize=100,
            speckleRange=2,
            mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
        )

    def match(
        self,
        left: np.ndarray,
        right: np.ndarray,
        *,
        t_ns: int = 0,
        given: np.ndarray | None = None,
    ) -> DisparityMap:
        """See `Depth.match`; confidence is 1 wherever the engine answered."""
        check_pair(self._camera, left, right)
        pad = self._max_px
        wide = [
            cv2.copyMakeBorder(image[: self._rows], 0, 0, pad, 0, cv2.BORDER_REPLICATE)
            for image in (left, right)
        ]
        fixed = self._engine.compute(wide[0], wide[1])[:, pad:]
        disparity = np.zeros(left.shape, np.float32)
        np.multiply(fixed, _SCALE, out=disparity[: self._rows], casting="same_kind")
        return disparity_map(t_ns, disparity, self._max_px, None)
