"""Perception on one page: a pair of images goes in, what the robot sees comes out."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager

import cv2
import numpy as np

from robot.config import PerceptionConfig, RobotConfig
from robot.geometry.stereo import StereoCamera
from robot.messages import Landmark, Marker, Seen, StereoFrame
from robot.perception.confidence import Confidence
from robot.perception.depth import Depth
from robot.perception.descriptor import Describer
from robot.perception.edges import EdgeFinder
from robot.perception.exposure import Exposure
from robot.perception.floor import Floor
from robot.perception.landmarks import LandmarkMaker
from robot.perception.marker import MarkerFinder, as_landmark
from robot.perception.odometry import VisualOdometry
from robot.perception.point_stereo import measure
from robot.perception.rectify import Rectifier, check_image
from robot.perception.scan import ScanMaker
from robot.perception.tracks import Tracker, TrackIds

SMOOTHING_PX = (5, 5)  # the binomial kernel of that size has a sigma of 1 px, and is quick


class Perception:
    """The chain for one camera. It remembers tracks and the floor, and nothing else.

    `clock` reads nanoseconds and fills `Seen.stage_ms`; the default measures nothing.
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
        self._config, self._camera = config, camera
        self._depth, self._rectifier, self._clock = depth, rectifier, clock
        self._centre = np.array([camera.cx_px, camera.cy_px])
        self._ids = TrackIds()
        self._exposure = Exposure()
        self._confidence = Confidence(config, camera)
        self._floor = Floor(camera)
        self._scan = ScanMaker(config, camera)
        self._tracker = Tracker(config, camera, self._ids)
        self._landmarks = LandmarkMaker(config, camera)
        self._edges = EdgeFinder(config, camera, self._ids) if config.edges else None
        self._odometry = VisualOdometry(camera, config.max_step_m)
        self._marker = MarkerFinder(config, robot, camera)
        self._marker_track = -1
        # The left image and the trusted disparity of the newest frame, for people only.
        self.looked: tuple[np.ndarray, np.ndarray] | None = None

    def see(self, frame: StereoFrame, arrived_ns: int, given: np.ndarray | None = None) -> Seen:
        """Everything about one frame. `given` is a simulator's true disparity (h, w), if it has it.

        Raises FrameError for images of another size than the camera's.
        """
        stage_ms: dict[str, float] = {}
        stage = self._stopwatch(stage_ms)
        with stage("rectify"):
            left, right = self._rectified(frame)
        with stage("disparity"):
            found = self._depth.match(left, right, t_ns=frame.t_ns, given=given)
        with stage("confidence"):
            trusted = self._confidence.check(left, right, found)
            self._exposure.learn(left, right, trusted.disparity_px)
        self.looked = (left, trusted.disparity_px)
        with stage("scan"):
            floor = self._floor.update(trusted.disparity_px, self._config.max_disparity_px)
            scan = self._scan.make(trusted.disparity_px, floor)
        with stage("tracks"):
            smooth, smooth_right = (
                cv2.GaussianBlur(eye, SMOOTHING_PX, 0.0) for eye in (left, right)
            )
            turn_rad = frame.yaw_change_rad
            guess = self._odometry.expected_motion(turn_rad)
            expected = self._odometry.expected_pixels(turn_rad)
            tracks = self._tracker.follow(smooth, expected, told=math.isfinite(turn_rad))
            ground_px = floor.disparity_px(*(tracks.pixel - self._centre).T)
            points = measure(smooth, smooth_right, trusted.disparity_px, tracks, ground_px)
        with stage("motion"):
            motion, points = self._odometry.update(points, turn_rad)
        with stage("landmarks"):
            describer = Describer(smooth)
            landmarks = self._landmarks.points(points, describer, floor)
        with stage("edges"):
            if self._edges is not None:
                landmarks += self._edges.find(
                    smooth, smooth_right, trusted.disparity_px, describer, guess.yaw_rad
                )
        with stage("marker"):
            marker = self._marker.find(left)
            landmarks += self._marker_landmark(marker)
        return Seen(
            t_ns=frame.t_ns,
            arrived_ns=arrived_ns,
            seq=frame.seq,
            landmarks=tuple(landmarks),
            scan=scan,
            quality=trusted.share,
            motion=motion,
            marker=marker,
            stage_ms=stage_ms,
        )

    def _rectified(self, frame: StereoFrame) -> tuple[np.ndarray, np.ndarray]:
        if self._rectifier is not None:
            left, right = self._rectifier.rectify(frame.left, frame.right)
        else:
            left, right = frame.left, frame.right
            for side, image in (("left", left), ("right", right)):
                check_image(
                    image,
                    self._camera.width_px,
                    self._camera.height_px,
                    side,
                    "set camera.width_px and camera.height_px, or name a calibration",
                )
        return left, self._exposure.match(left, right)

    def _marker_landmark(self, marker: Marker | None) -> list[Landmark]:
        """The marker as a landmark, under one track number while it stays in sight."""
        if marker is None:
            self._marker_track = -1
            return []
        if self._marker_track < 0:
            self._marker_track = int(self._ids.take(1)[0])
        return [as_landmark(marker, self._marker_track)]

    def _stopwatch(
        self, stage_ms: dict[str, float]
    ) -> Callable[[str], AbstractContextManager[None]]:
        @contextmanager
        def stage(name: str) -> Iterator[None]:
            before_ns = self._clock()
            yield
            stage_ms[name] = (self._clock() - before_ns) / 1e6

        return stage
