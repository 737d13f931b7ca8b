"""No matching at all: the disparity that a simulator knows."""

from __future__ import annotations

import numpy as np

from robot.errors import FrameError
from robot.geometry.stereo import StereoCamera
from robot.messages import DisparityMap
from robot.perception.depth.base import check_pair, disparity_map


class GivenDepth:
    """Hands the given disparity through."""

    def __init__(self, camera: StereoCamera) -> None:
        self._camera = camera

    def match(
        self,
        left: np.ndarray,
        right: np.ndarray,
        *,
        t_ns: int = 0,
        given: np.ndarray | None = None,
    ) -> DisparityMap:
        """See `Depth.match`. Raises FrameError when nothing was given."""
        check_pair(self._camera, left, right)
        if given is None or given.shape != left.shape:
            raise FrameError(
                "perception.matcher is 'given' but this frame comes without true disparity; "
                "use 'sgbm' or 'onnx' outside the simulator."
            )
        return disparity_map(t_ns, given, np.inf, None)
