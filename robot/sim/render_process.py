"""The renderer in a process of its own, so that the world goes on while a picture is drawn."""

from __future__ import annotations

import multiprocessing
import signal
from dataclasses import replace
from multiprocessing.connection import Connection

import numpy as np

from robot.config import SimConfig
from robot.errors import SceneError
from robot.geometry.se2 import SE2
from robot.geometry.stereo import StereoCamera
from robot.messages import StereoFrame

ENDING_S = 10.0  # between closing the pipe and the end of the process


class RenderProcess:
    """Requests are answered in order; several may be under way. Raises SceneError if it dies."""

    def __init__(self, scene: str, camera: StereoCamera, sim: SimConfig, seed: int) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, child = context.Pipe()
        self._scene = scene
        self._process = context.Process(
            target=_draw, args=(child, scene, camera, sim, seed), daemon=True
        )
        self._process.start()
        child.close()

    def request(self, t_ns: int, seq: int, world_from_base: SE2) -> None:
        """Ask for the pair seen from a pose (scene coordinates)."""
        try:
            self._pipe.send((t_ns, seq, world_from_base))
        except OSError:
            raise self._died() from None

    def result(self, yaw_change_rad: float = float("nan")) -> tuple[StereoFrame, np.ndarray]:
        """Wait for the oldest request's frame and true disparity.

        However long it takes, as on a busy machine: only a dead process ends the wait.
        """
        try:
            t_ns, seq, shape = self._pipe.recv()
            left = np.frombuffer(self._pipe.recv_bytes(), np.uint8).reshape(shape)
            right = np.frombuffer(self._pipe.recv_bytes(), np.uint8).reshape(shape)
            disparity = np.frombuffer(self._pipe.recv_bytes(), np.float32).reshape(shape)
        except (EOFError, OSError):
            raise self._died() from None
        frame = StereoFrame(t_ns, seq, left, right)
        return replace(frame, yaw_change_rad=yaw_change_rad), disparity

    def close(self) -> None:
        """End the process. May be called again."""
        self._pipe.close()
        self._process.join(timeout=2.0)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()

    def _died(self) -> SceneError:
        self._process.join(timeout=ENDING_S)
        code = self._process.exitcode
        end = "is still ending" if code is None else f"has ended (exit code {code})"
        return SceneError(
            f"scene '{self._scene}': the renderer's process {end} and draws nothing more; run "
            "again, and if that happens again try another scene or a machine that is less busy."
        )


def _draw(pipe: Connection, scene: str, camera: StereoCamera, sim: SimConfig, seed: int) -> None:
    """Life of the second process: ends when the other end of the pipe is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the run; the pipe ends this
    from robot.sim.rig import StereoRig
    from robot.sim.scene import load_scene

    rig = StereoRig(load_scene(scene), camera, sim, seed)
    try:
        while True:
            t_ns, seq, pose = pipe.recv()
            frame, disparity = rig.render(t_ns, seq, pose)
            pipe.send((t_ns, seq, disparity.shape))
            for image in (frame.left, frame.right, disparity):
                pipe.send_bytes(image.tobytes())
    except (EOFError, OSError):
        return
