"""Keeps what is drawn on the map, the rooms, the fan and the wear of parts fresh for page and MQTT.

The runtime is asked seldom: after it has come, after a change, after a run, and now and then. Rooms
cost it a look at its whole map, so during a run they are asked for only when much floor is new.
"""

from __future__ import annotations

import asyncio
import contextlib
from typing import Any

from robot.serve.capability import RESTING
from robot.serve.runtime import Runtime, Unreachable

AGAIN_S = 60.0
SETTLE_S = 0.3  # several changes at once are one
MUCH_NEW = 1.5  # times as many tiles as when the rooms were asked for


class Ledger:
    """A service; fills `World.drawn`."""

    def __init__(self, runtime: Runtime, again_s: float = AGAIN_S) -> None:
        self._runtime, self._again_s = runtime, again_s
        self._rested = False
        self._tiles = 0  # of the map, when the rooms were asked for

    async def run(self) -> None:
        """For ever."""
        world = self._runtime.world
        box = world.subscribe()
        wanted = True
        try:
            while True:
                if wanted and world.connected:
                    await asyncio.sleep(SETTLE_S)
                    box.kinds.clear()
                    with contextlib.suppress(Unreachable):
                        await self._refresh()
                try:
                    wanted = False
                    async with asyncio.timeout(self._again_s):
                        while not wanted:
                            await box.bell.wait()
                            box.bell.clear()
                            box.tiles.clear()
                            wanted = bool(box.kinds & {"hello", "edited"}) or self._has_ended()
                            box.kinds.clear()
                except TimeoutError:
                    wanted = True
        finally:
            world.unsubscribe(box)

    def _has_ended(self) -> bool:
        """Whether a run has just ended."""
        rested, self._rested = self._rested, self._resting()
        return self._rested and not rested

    def _resting(self) -> bool:
        return self._runtime.world.status.get("state") in RESTING

    async def _refresh(self) -> None:
        world = self._runtime.world
        drawn = dict(world.drawn)
        if world.has("map show"):
            data = await self._ask("map show")
            drawn["annotations"] = data.get("annotations", drawn.get("annotations", {}))
            drawn["snapshots"] = data.get("snapshots", drawn.get("snapshots", []))
        if world.has("consumables"):
            data = await self._ask("consumables")
            drawn["parts"] = {key: data.get(key, {}) for key in ("hours", "life_h")}
        if world.has("fan"):
            drawn["fan"] = await self._ask("fan")
        if world.has("rooms") and (self._resting() or len(world.tiles) > MUCH_NEW * self._tiles):
            self._tiles = len(world.tiles)
            drawn["rooms"] = (await self._ask("rooms")).get("rooms", drawn.get("rooms", []))
        world.draw(drawn)

    async def _ask(self, verb: str) -> dict[str, Any]:
        data: dict[str, Any] = (await self._runtime.request(verb))["data"]
        return data


def left_pct(drawn: dict[str, Any]) -> dict[str, float]:
    """How much of each part's life is left."""
    parts = drawn.get("parts", {})
    hours, life = parts.get("hours", {}), parts.get("life_h", {})
    return {
        part: round(max(0.0, 100.0 * (1.0 - hours[part] / life[part])), 1)
        for part in hours
        if life.get(part)
    }
