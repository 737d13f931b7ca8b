"""The live line to a browser: a WebSocket that sends what changed, at the reader's own pace."""

from __future__ import annotations

import asyncio
import json
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketState

from robot.body.talk import stream
from robot.serve.capability import Robot
from robot.serve.driver import MAX_LAG, Driver, read_wish
from robot.serve.world import Mailbox

MAX_SOCKETS = 128
MIN_PERIOD_S = 0.1  # no reader is told more often
SEND_S = 15.0  # a reader that takes nothing for so long is hung up on
MAX_WISHES_PER_S = 30
PLAIN = ("hello", "status", "pose", "landmarks", "map", "drawn")


class Live:
    """All browsers that are connected now."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._driver = Driver(robot.runtime)
        self.count = 0

    async def __call__(self, socket: WebSocket) -> None:
        """Serve one browser until it leaves."""
        if self.count >= MAX_SOCKETS:
            await socket.close(1013)
            return
        self.count += 1
        box = self._robot.world.subscribe()
        try:
            await socket.accept()
            reader = _Reader(socket, box, self._robot, self._driver)
            tasks = {asyncio.create_task(reader.tell()), asyncio.create_task(reader.listen())}
            try:
                done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            finally:
                for task in tasks:
                    task.cancel()
                await asyncio.gather(*tasks, return_exceptions=True)
            for task in done:
                error = task.exception()
                if error is not None and not isinstance(error, GONE):
                    raise error
            if socket.application_state is not WebSocketState.DISCONNECTED:
                await socket.close(1008)
        except (*GONE, asyncio.CancelledError):  # cancelled: the server itself ends
            pass
        finally:
            self._driver.release(box)
            self._robot.world.unsubscribe(box)
            self.count -= 1


GONE = (WebSocketDisconnect, RuntimeError, OSError, TimeoutError)


class _Reader:
    """One browser."""

    def __init__(self, socket: WebSocket, box: Mailbox, robot: Robot, driver: Driver) -> None:
        self._socket, self._box, self._robot, self._driver = socket, box, robot, driver
        self._wants_landmarks = False
        self._track = (-1, 0)

    async def tell(self) -> None:
        """Send what is new, for ever."""
        while True:
            await self._box.bell.wait()
            self._box.bell.clear()
            kinds, self._box.kinds = self._box.kinds, set()
            tiles, self._box.tiles = self._box.tiles, set()
            async with asyncio.timeout(SEND_S):
                await self._words(kinds)
                places = sorted(tiles)
                for start in range(0, len(places), stream.TILES_PER_FRAME):
                    batch = frozenset(places[start : start + stream.TILES_PER_FRAME])
                    await self._socket.send_bytes(stream.TILES + self._robot.world.packed(batch))
                for number, eye in enumerate(stream.EYES):
                    if f"image-{eye}" in kinds and eye in self._robot.world.images:
                        image = self._robot.world.images[eye]
                        await self._socket.send_bytes(stream.IMAGE + bytes([number]) + image)
            await asyncio.sleep(MIN_PERIOD_S)

    async def listen(self) -> None:
        """Obey wishes until the browser leaves or talks nonsense."""
        loop = asyncio.get_running_loop()
        since, wishes = loop.time(), 0
        while True:
            text = (await self._socket.receive()).get("text")
            if text is None:  # it has left, or sent bytes
                return
            if loop.time() - since > 1.0:
                since, wishes = loop.time(), 0
            wishes += 1
            try:
                wish = json.loads(text)
                eyes = [eye for eye in wish.get("look", []) if isinstance(eye, str)]
                landmarks = wish.get("landmarks")
            except (ValueError, AttributeError, TypeError, RecursionError):
                return
            if wishes > MAX_WISHES_PER_S:
                return
            if "drive" in wish:
                await self._drive(wish)
            self._robot.runtime.look(eyes)
            if isinstance(landmarks, bool):
                self._wants_landmarks = landmarks
                self._box.kinds.add("landmarks")
                self._box.bell.set()

    async def _drive(self, wish: dict[str, Any]) -> None:
        """A wish by hand: `n` counts the page's wishes, `seen` the answers that have reached it."""
        drive, number, seen = read_wish(wish["drive"]), wish.get("n"), wish.get("seen")
        why_not = ""
        if not isinstance(number, int) or not isinstance(seen, int):
            number, seen, drive = 0, 0, None
        if drive is None or not self._robot.world.has("manual"):
            self._driver.release(self._box)
        elif number - seen > MAX_LAG:
            self._driver.release(self._box)
            why_not = "the line to the robot lags; it stands until the line is quick again"
        else:
            why_not = self._driver.drive(self._box, drive)
        answer = {"type": "drove", "n": number, "refused": why_not}
        await self._socket.send_text(json.dumps(answer))

    async def _words(self, kinds: set[str]) -> None:
        world = self._robot.world
        news: dict[str, Any] = {
            "hello": {**world.hello, "type": "hello", "connected": world.connected},
            "status": world.status,
            "pose": world.pose,
            "landmarks": {"type": "landmarks", "points": world.landmarks},
            "map": {"type": "map", "resolution_m": world.resolution_m},
            "drawn": {"type": "drawn", **world.drawn} if world.drawn else None,
        }
        if not self._wants_landmarks:
            kinds.discard("landmarks")
        for kind in PLAIN:
            if kind in kinds and news[kind] is not None:
                await self._socket.send_text(json.dumps(news[kind]))
        number, sent = self._track
        first = sent if number == world.track_number and sent <= len(world.track) else 0
        if "track" in kinds and (first < len(world.track) or number != world.track_number):
            crumbs = {"type": "track", "first": first, "xy_m": world.track[first:]}
            await self._socket.send_text(json.dumps(crumbs))
            self._track = (world.track_number, len(world.track))
