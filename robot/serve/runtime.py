"""The line to the runtime: its unix socket, and nothing else."""

from __future__ import annotations

import asyncio
import contextlib
import json
from pathlib import Path
from typing import Any

from robot.body.talk.stream import EYES, StreamError, Unframer
from robot.serve.world import World

ANSWER_S = 5.0
ROOMS_S = 12.5  # the robot's worker may have to find its rooms first
MAX_LINE_BYTES = 4000  # what the robot reads at once
CHECK_S = 8.0
PICTURE_S = 2.0
MAX_ANSWER_BYTES = 1 << 20
EDITS = frozenset(
    {
        "room split", "room join", "room name", "no-go add", "no-go remove", "wall add",
        "wall remove", "map undo", "map snapshot", "map restore", "consumables reset",
        "zone add", "zone remove", "fan",
    }
)  # fmt: skip
RETRY_S = (0.2, 0.5, 1.0, 2.0)


class Unreachable(Exception):
    """No runtime answers; the text is for people."""


class Runtime:
    """Requests on connections of their own; one long connection that fills the world."""

    def __init__(self, path: Path, world: World) -> None:
        self._path, self.world = path, world
        self._writer: asyncio.StreamWriter | None = None

    async def request(self, verb: str, args: list[str] | None = None) -> dict[str, Any]:
        """Hand one request over: accepted, reason, and data for programs. Raises Unreachable."""
        line = json.dumps({"verb": verb, "args": args or []}).encode() + b"\n"
        if len(line) > MAX_LINE_BYTES:
            return {"accepted": False, "reason": "that is too long; send less at once", "data": {}}
        try:
            async with asyncio.timeout(ROOMS_S if "room" in verb else ANSWER_S):
                reader, writer = await asyncio.open_unix_connection(
                    str(self._path), limit=MAX_ANSWER_BYTES
                )
                try:
                    writer.write(line)
                    answer = json.loads(await reader.readline() or b"{}")
                finally:
                    writer.close()
                    with contextlib.suppress(OSError):
                        await writer.wait_closed()
        except (OSError, ValueError) as error:  # TimeoutError is an OSError
            raise Unreachable(f"the robot's runtime does not answer ({_why(error)})") from None
        accepted, data = answer.get("accepted") is True, answer.get("data")
        if accepted and verb in EDITS and (args or verb != "fan"):  # without a level it only tells
            self.world.edited()
        return {
            "accepted": accepted,
            "reason": str(answer.get("reason", "")),
            "data": data if isinstance(data, dict) else {},
        }

    async def watch(self) -> None:
        """Fill the world for ever, through every restart of the runtime."""
        tries = 0
        while True:
            try:
                await self._watch_once()
                tries = 0
            except (OSError, StreamError):
                pass
            was_connected = self.world.connected
            self.world.lost()
            tries = 0 if was_connected else tries + 1
            await asyncio.sleep(RETRY_S[min(tries, len(RETRY_S) - 1)])

    def look(self, eyes: list[str]) -> None:
        """Ask for pictures for the next moments."""
        eyes = [eye for eye in eyes if eye in EYES and eye in self.world.hello.get("eyes", ())]
        if eyes:
            self._say({"look": eyes})

    async def check(self) -> list[dict[str, str]]:
        """The robot's findings about itself. Raises Unreachable."""
        box = self.world.subscribe()
        try:
            box.kinds.clear()
            self._say({"check": True})
            async with asyncio.timeout(CHECK_S):
                while "check" not in box.kinds:
                    box.bell.clear()
                    await box.bell.wait()
        except TimeoutError:
            raise Unreachable("the robot's runtime does not answer") from None
        finally:
            self.world.unsubscribe(box)
        return self.world.checks

    async def picture(self, eye: str) -> bytes | None:
        """A fresh picture, or None when the robot has none to give."""
        if eye not in self.world.hello.get("eyes", ()):
            return None
        box = self.world.subscribe()
        try:
            box.kinds.clear()
            self.look([eye])
            async with asyncio.timeout(PICTURE_S):
                while f"image-{eye}" not in box.kinds:
                    box.bell.clear()
                    await box.bell.wait()
        except TimeoutError:
            return None
        finally:
            self.world.unsubscribe(box)
        return self.world.images.get(eye)

    # ------------------------------------------------------------------ parts

    async def _watch_once(self) -> None:
        reader, writer = await asyncio.open_unix_connection(str(self._path))
        self._writer = writer
        unframer = Unframer()
        try:
            writer.write(b'{"verb": "watch"}\n')
            while data := await reader.read(1 << 16):
                for kind, payload in unframer.feed(data):
                    self.world.take(kind, payload)
        finally:
            self._writer = None
            writer.close()

    def _say(self, wish: dict[str, Any]) -> None:
        if self._writer is not None and not self._writer.is_closing():
            self._writer.write(json.dumps(wish).encode() + b"\n")


def _why(error: Exception) -> str:
    return getattr(error, "strerror", None) or "it is silent"
