"""`sweeper bench pipeline`: recorded stereo through rectification, perception, SLAM and the brain.

It is the code that drives the robot, on one thread, measured: frames a second (without reading and
decoding the image files, which a camera does not need), latency of each stage, peak memory, and
the error of the estimated track where the recording moves in a plane and has truth.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import msgspec
import numpy as np

from robot.bench.memory import peak_rss_mb, reset_peak
from robot.body.recorded import RecordedBody
from robot.body.recordings import Recording, find_recordings, open_recording
from robot.body.sources import open_depth
from robot.brain import Brain
from robot.config import Config
from robot.evaluate.frame_picture import draw_frame
from robot.evaluate.latency import percentiles
from robot.evaluate.planar import planar_track
from robot.evaluate.trajectory import compare_tracks
from robot.geometry.stereo import base_from_cam
from robot.messages import Command, DisparityMap, Event, PoseEstimate, Seen, StereoFrame
from robot.perception.chain import Perception
from robot.perception.depth import Depth
from robot.perception.rectify import Rectifier
from robot.run import run

MAX_STEP_M = 3.0  # between two frames: 30 m/s at 10 Hz
PICTURES = 3  # per sequence, evenly spread


def bench_pipeline(paths: Sequence[Path], config: Config, out_dir: Path) -> dict[str, Any]:
    """Measure every recording among `paths` (folders, or folders of them), one after the other.

    Writes pictures to `out_dir`. Raises FrameError, CalibrationError or ModelError for input that
    cannot be used.
    """
    recordings = [open_recording(path) for path in find_recordings(paths)]
    out_dir.mkdir(parents=True, exist_ok=True)
    with _one_thread():
        return {"sequences": [_measure(r, config, out_dir) for r in recordings]}


def _measure(recording: Recording, config: Config, out_dir: Path) -> dict[str, Any]:
    reset_peak()
    mount = base_from_cam(0.0, 0.0, recording.camera_height_m or config.camera.z_m)
    size = config.camera.width_px, config.camera.height_px
    rectifier = Rectifier(recording.calibration, *size, mount)
    depth = _LastDisparity(open_depth(config, rectifier.camera))
    # Recordings come from drones and cars as well, which are faster than this robot.
    eager = msgspec.structs.replace(config.perception, max_step_m=MAX_STEP_M)
    perception = Perception(
        eager, config.robot, rectifier.camera, depth, rectifier, clock=time.perf_counter_ns
    )
    painter = _Painter(recording, rectifier, depth, config.perception.max_disparity_px, out_dir)
    sees = _TimedPerception(perception, painter)
    body = RecordedBody(recording, sees, gyro_up=mount[2, :3])
    brain = _TimedBrain(config)
    run(body, brain, _NoLog())
    frame_ms = [see + think for see, think in zip(sees.ms, brain.frame_ms, strict=True)]
    stages = {**sees.stage_ms, "brain": brain.frame_ms, "frame": frame_ms}
    return {
        "name": recording.name,
        "frames": body.count.seen,
        "frames_lost": body.count.lost + body.count.reordered,
        "fps": round(1000.0 * len(frame_ms) / sum(frame_ms), 1) if frame_ms else None,
        "stage_ms": {
            stage: percentiles(ms) for stage, ms in (stages | {"read": body.count.read_ms}).items()
        },
        "peak_rss_mb": peak_rss_mb(),
        "ate_rmse_m": track_error_m(recording, mount, brain.track(recording.pairs[0].t_ns)),
    }


def track_error_m(recording: Recording, mount: np.ndarray, track: np.ndarray) -> float | None:
    """ATE of a track (n, 4); None without truth, or where it does not move in a plane."""
    t_s = (recording.truth_t_ns - recording.pairs[0].t_ns) * 1e-9
    truth = planar_track(t_s, recording.truth @ np.linalg.inv(mount))
    if truth is None or len(track) == 0:
        return None
    error = compare_tracks(track, truth)
    return round(error.ate_rmse_m, 4) if error else None


class _TimedPerception:
    """Perception, timed from outside; what is painted of its result is not counted."""

    def __init__(self, perception: Perception, painter: _Painter) -> None:
        self._perception, self._painter = perception, painter
        self.ms: list[float] = []
        self.stage_ms: dict[str, list[float]] = {}

    def see(self, frame: StereoFrame, arrived_ns: int) -> Seen:
        before_ns = time.perf_counter_ns()
        seen = self._perception.see(frame, arrived_ns)
        self.ms.append((time.perf_counter_ns() - before_ns) / 1e6)
        for stage, ms in seen.stage_ms.items():
            self.stage_ms.setdefault(stage, []).append(ms)
        self._painter.see(frame, seen)
        return seen


class _TimedBrain(Brain):
    """The brain, timed from outside: all it does from one frame to the next is that frame's."""

    def __init__(self, config: Config) -> None:
        super().__init__(config)
        self._track: list[tuple[int, float, float, float]] = []
        self.frame_ms: list[float] = []

    def on(self, event: Event) -> list[Command]:
        before_ns = time.perf_counter_ns()
        commands = super().on(event)
        spent_ms = (time.perf_counter_ns() - before_ns) / 1e6
        if isinstance(event, Seen):
            self.frame_ms.append(spent_ms)
        elif self.frame_ms:
            self.frame_ms[-1] += spent_ms
        for command in commands:
            if isinstance(command, PoseEstimate):
                pose = command.world_from_base
                self._track.append((command.t_ns, pose.x_m, pose.y_m, pose.yaw_rad))
        return commands

    def track(self, start_ns: int) -> np.ndarray:
        """Estimated track (n, 4) of seconds after `start_ns`, x_m, y_m, yaw_rad."""
        rows = [((t_ns - start_ns) * 1e-9, *pose) for t_ns, *pose in self._track]
        return np.array(rows).reshape(-1, 4)


class _LastDisparity:
    """A matcher that remembers its last answer, for the pictures."""

    def __init__(self, depth: Depth) -> None:
        self._depth = depth
        self.last: DisparityMap | None = None

    def match(self, left: np.ndarray, right: np.ndarray, **keywords: Any) -> DisparityMap:
        self.last = self._depth.match(left, right, **keywords)
        return self.last


class _Painter:
    """Writes a few pictures, evenly spread over the sequence."""

    def __init__(
        self,
        recording: Recording,
        rectifier: Rectifier,
        depth: _LastDisparity,
        max_disparity_px: int,
        out_dir: Path,
    ) -> None:
        count = len(recording.pairs)
        self._wanted = {(2 * i + 1) * count // (2 * PICTURES) for i in range(PICTURES)}
        self._name, self._rectifier, self._depth = recording.name, rectifier, depth
        self._max_disparity_px, self._out_dir = max_disparity_px, out_dir

    def see(self, frame: StereoFrame, seen: Seen) -> None:
        """Paint the frame if it is one of the chosen."""
        if frame.seq not in self._wanted or self._depth.last is None:
            return
        left, _ = self._rectifier.rectify(frame.left, frame.right)
        disparity_px = self._depth.last.disparity_px
        png = draw_frame(left, disparity_px, self._rectifier.camera, seen, self._max_disparity_px)
        (self._out_dir / f"{self._name}_{frame.seq:06d}.png").write_bytes(png)


class _NoLog:
    """The bench keeps no log."""

    def event(self, event: Event) -> None: ...

    def command(self, command: Command) -> None: ...

    def flush(self) -> None: ...


@contextmanager
def _one_thread() -> Iterator[None]:
    """OpenCV on one thread, as the figures are given."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(threads)
