"""Driving by hand over the live line: a dead man's handle with four ways to let go.

A page repeats its wish while a person holds the control. The robot stops when the person lets go,
when the page's line ends or lags, when another thing goes wrong on the way, and at the latest when
the runtime has heard nothing for its own fraction of a second. Wishes never queue: the newest wins.
"""

from __future__ import annotations

import asyncio
import math
from typing import Any

from robot.serve.runtime import Runtime, Unreachable

HOLD_S = 0.35  # without a wish for so long, the hand has let go
MAX_LAG = 6  # wishes that the page may be ahead of the answers it has seen
MAX_V_MPS, MAX_YAW_RATE_RADPS = 1.0, 6.0
Wish = tuple[float, float]
HALT: Wish = (0.0, 0.0)


class Driver:
    """One hand at a time."""

    def __init__(self, runtime: Runtime) -> None:
        self._runtime = runtime
        self._hand: object | None = None
        self._wish: Wish | None = None
        self._heard_s = 0.0
        self._task: asyncio.Task[None] | None = None
        self._refusal: tuple[object, str, float] | None = None  # whose, why, when

    def drive(self, hand: object, wish: Wish) -> str:
        """Take the newest wish of a hand; returns why not, empty while all is well."""
        loop = asyncio.get_running_loop()
        if self._hand is not None and self._hand is not hand:
            return "somebody else drives it by hand"
        if self._refusal is not None and self._refusal[0] is hand:
            _, why_not, when_s = self._refusal
            if loop.time() - when_s < HOLD_S:
                return why_not
        self._hand, self._wish, self._heard_s = hand, wish, loop.time()
        if self._task is None or self._task.done():
            self._task = asyncio.create_task(self._send())
        return ""

    def release(self, hand: object) -> None:
        """The hand has let go: stop now."""
        if self._hand is hand:
            self._heard_s, self._wish = -math.inf, None

    async def _send(self) -> None:
        """Hand wishes over until the hand lets go, then stop."""
        loop = asyncio.get_running_loop()
        try:
            while loop.time() - self._heard_s < HOLD_S:
                wish, self._wish = self._wish, None
                if wish is not None and not await self._ask(wish):
                    return
                await asyncio.sleep(0.01)
            await self._ask(HALT)
        finally:
            self._hand = None

    async def _ask(self, wish: Wish) -> bool:
        try:
            answer = await self._runtime.request("manual", [f"{value:.3f}" for value in wish])
        except Unreachable as error:
            answer = {"accepted": False, "reason": str(error)}
        if not answer["accepted"]:
            now_s = asyncio.get_running_loop().time()
            self._refusal = (self._hand, answer["reason"] or "it does not drive now", now_s)
        return bool(answer["accepted"])


def read_wish(value: Any) -> Wish | None:
    """[v_mps, yaw_rate_radps] within bounds, None for anything else."""
    if not isinstance(value, list) or len(value) != 2:
        return None
    for number, most in zip(value, (MAX_V_MPS, MAX_YAW_RATE_RADPS), strict=True):
        if not isinstance(number, int | float) or isinstance(number, bool):
            return None
        if not math.isfinite(number) or abs(number) > most:
            return None
    return float(value[0]), float(value[1])
