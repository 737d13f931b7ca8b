"""The controller's microsecond clock on the host's time axis.

Every answer says when (controller time) its order was taken, and the host knows when it was sent.
An order is never taken before it is sent, so `sent - taken` is a lower bound of the offset between
the clocks, and tight for the order that waited least. Of each half second the tightest bound is
kept; the drift is the Theil-Sen slope (median over pairs) of the last eight seconds of them, which
a stalled host does not bend. (The bound from the other side, the arrival of telemetry, is looser
by how long the host lets it wait.)
Sources: Cristian, "Probabilistic clock synchronization", Distributed Computing 3, 1989; Sen,
"Estimates of the regression coefficient based on Kendall's tau", JASA 63, 1968.
"""

from __future__ import annotations

from collections import deque
from itertools import combinations
from statistics import median

from firmware_bridge.counting import EndlessCounter

NS_PER_US = 1000
BLOCK_NS = 500_000_000
BLOCKS = 16
MIN_SPAN_NS = 2_000_000_000  # shorter than this, drift cannot be told from waiting
MAX_DRIFT = 0.01  # twice what a ceramic resonator is off


class ClockMap:
    """Maps controller microseconds (32 bits, wrapping) to host nanoseconds."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget everything: the controller or the session is another one."""
        self._counter = EndlessCounter()
        self._blocks: deque[tuple[int, int]] = deque(maxlen=BLOCKS)  # (controller ns, offset ns)
        self._block_start_ns = 0
        self._drift = 0.0

    @property
    def ready(self) -> bool:
        """Whether anything has been observed."""
        return bool(self._blocks)

    def observe(self, taken_us: int, sent_ns: int) -> None:
        """An order sent at host time `sent_ns` was taken at controller time `taken_us`."""
        at_ns = self._counter.follow(taken_us) * NS_PER_US
        offset_ns = sent_ns - at_ns
        if not self._blocks or at_ns - self._block_start_ns >= BLOCK_NS:
            self._drift = self._fit()
            self._block_start_ns = at_ns
            self._blocks.append((at_ns, offset_ns))
        elif offset_ns > self._predict(*self._blocks[-1], at_ns):
            self._blocks[-1] = (at_ns, offset_ns)

    def to_host_ns(self, controller_us: int) -> int:
        """Host time of a controller time at most 35 minutes from the last one seen.

        Only meaningful once `ready`.
        """
        at_ns = self._counter.follow(controller_us) * NS_PER_US
        return at_ns + max(self._predict(*block, at_ns) for block in self._blocks)

    def _predict(self, block_ns: int, offset_ns: int, at_ns: int) -> int:
        return offset_ns + round(self._drift * (at_ns - block_ns))

    def _fit(self) -> float:
        """Drift of the offset, from the blocks that have ended."""
        if not self._blocks or self._blocks[-1][0] - self._blocks[0][0] < MIN_SPAN_NS:
            return 0.0
        pairs = combinations(self._blocks, 2)
        slope = median((end[1] - start[1]) / (end[0] - start[0]) for start, end in pairs)
        return max(-MAX_DRIFT, min(MAX_DRIFT, slope))
