"""What a simulated robot sees with: rendered pictures through the real perception, or drawn sights.

Both answer in the order of the requests, however long they take, so a seed gives the same life.
"""

from __future__ import annotations

from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TYPE_CHECKING, Protocol

from robot.geometry.se2 import SE2
from robot.messages import Seen, StereoFrame

if TYPE_CHECKING:
    from robot.perception.chain import Perception
    from robot.sim.drawn import DrawnSight
    from robot.sim.render_process import RenderProcess


class Eyes(Protocol):
    """Two steps, so that a picture can be made while the world goes on."""

    def expose(
        self, t_ns: int, arrives_ns: int, seq: int, world_from_base: SE2, yaw_change_rad: float
    ) -> None:
        """Look from a pose in the scene; `yaw_change_rad` is the gyro's, since the last look."""

    def seen(self) -> tuple[StereoFrame | None, Seen]:
        """What the oldest look showed, and the picture if there is one."""

    def close(self) -> None:
        """Nothing more will be asked."""


class RenderedEyes:
    """Frames drawn in a second process and perceived in a second thread, as on the robot."""

    def __init__(self, renderer: RenderProcess, perception: Perception) -> None:
        self._renderer = renderer
        self._perception = perception
        self._thread = ThreadPoolExecutor(1, "perception")
        self._looks: deque[Future[tuple[StereoFrame, Seen]]] = deque()

    def expose(
        self, t_ns: int, arrives_ns: int, seq: int, world_from_base: SE2, yaw_change_rad: float
    ) -> None:
        """See `Eyes`."""
        self._renderer.request(t_ns, seq, world_from_base)
        self._looks.append(self._thread.submit(self._perceive, arrives_ns, yaw_change_rad))

    def _perceive(self, arrives_ns: int, yaw_change_rad: float) -> tuple[StereoFrame, Seen]:
        frame, disparity_px = self._renderer.result(yaw_change_rad)
        return frame, self._perception.see(frame, arrives_ns, given=disparity_px)

    def seen(self) -> tuple[StereoFrame | None, Seen]:
        """See `Eyes`. Raises SceneError when the renderer has died."""
        return self._looks.popleft().result()

    def close(self) -> None:
        """See `Eyes`."""
        self._thread.shutdown(cancel_futures=True)
        self._renderer.close()


class DrawnEyes:
    """Sights drawn from perception's measured errors: many times faster, and no pictures."""

    def __init__(self, sight: DrawnSight) -> None:
        self._sight = sight
        self._looks: deque[Seen] = deque()

    def expose(
        self, t_ns: int, arrives_ns: int, seq: int, world_from_base: SE2, yaw_change_rad: float
    ) -> None:
        """See `Eyes`."""
        self._looks.append(self._sight.see(t_ns, arrives_ns, seq, world_from_base))

    def seen(self) -> tuple[StereoFrame | None, Seen]:
        """See `Eyes`."""
        return None, self._looks.popleft()

    def close(self) -> None:
        """See `Eyes`."""
