"""From a stereo frame to everything perception has to say about it, one stage after the other."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from robot.config import PerceptionConfig, RobotConfig
from robot.geometry.stereo import StereoCamera
from robot.messages import Seen, StereoFrame
from robot.perception.confidence import Confidence, match_exposure
from robot.perception.depth import Depth
from robot.perception.floor import Floor
from robot.perception.marker import MarkerFinder, marker_landmark
from robot.perception.rectify import Rectifier
from robot.perception.scan import ScanMaker


class Perception:
    """The whole room behind one call. Deterministic: the same frames give the same `Seen`s.

    `clock` returns nanoseconds for `stage_ms` only; without one all times are 0. `camera` is the
    rectified pair; `rectifier` is None when frames arrive rectified.
    """

    def __init__(
        self,
        config: PerceptionConfig,
        robot: RobotConfig,
        camera: StereoCamera,
        depth: Depth,
        rectifier: Rectifier | None = None,
        clock: Callable[[], int] = lambda: 0,
    ) -> None:
        self._config, self._depth, self._rectifier, self._clock = config, depth, rectifier, clock
        self._confidence = Confidence(config, camera)
        self._floor = Floor(camera)
        self._scan = ScanMaker(config, camera)
        self._marker = MarkerFinder(config, robot, camera)

    def see(self, frame: StereoFrame, arrived_ns: int, given: np.ndarray | None = None) -> Seen:
        """Perceive one frame. `given` is true disparity (h, w), used by the matcher "given".

        Raises FrameError for images that do not fit the camera.
        """
        watch = _Stopwatch(self._clock)
        left, right = frame.left, frame.right
        if self._rectifier is not None:
            left, right = self._rectifier.rectify(left, right)
        watch.lap("rectify")
        found = self._depth.match(left, right, t_ns=frame.t_ns, given=given)
        watch.lap("disparity")
        right = match_exposure(left, right)
        trusted = self._confidence.check(left, right, found)
        floor = self._floor.update(trusted.disparity_px, self._config.max_disparity_px)
        scan = self._scan.make(trusted.disparity_px, floor)
        watch.lap("scan")
        marker = self._marker.find(left)
        watch.lap("marker")
        landmarks = (marker_landmark(marker),) if marker else ()
        return Seen(
            frame.t_ns,
            arrived_ns,
            frame.seq,
            landmarks,
            scan,
            trusted.share,
            None,
            marker,
            watch.total(),
        )


class _Stopwatch:
    """Milliseconds per stage."""

    def __init__(self, clock: Callable[[], int]) -> None:
        self._clock = clock
        self._start = self._last = clock()
        self._ms: dict[str, float] = {}

    def lap(self, stage: str) -> None:
        now = self._clock()
        self._ms[stage] = (now - self._last) / 1e6
        self._last = now

    def total(self) -> dict[str, float]:
        return {**self._ms, "total": (self._last - self._start) / 1e6}
