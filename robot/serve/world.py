"""What this process knows of the robot: the newest of everything, and who wants to be told.

Each reader has a mailbox of *what* has changed, never of the changes themselves: a reader that is
slow gets the newest state later, and nothing piles up.
"""

from __future__ import annotations

import asyncio
import json
import zlib
from dataclasses import dataclass, field
from typing import Any

from robot.body.talk import stream
from robot.body.talk.stream import Place

MAX_TILES = 20_000  # 3 km^2 at 2.5 cm would be a mistake
MAX_TRACK = 100_000
FIRST = ("hello", "status", "pose", "track", "landmarks", "map", "drawn")
LOST = {
    "type": "status",
    "state": "unreachable",
    "reason": "the robot's runtime does not answer",
}


@dataclass(eq=False)
class Mailbox:
    """What one reader has not seen yet."""

    kinds: set[str] = field(default_factory=set)
    tiles: set[Place] = field(default_factory=set)
    bell: asyncio.Event = field(default_factory=asyncio.Event)


class World:
    """Filled by `robot.serve.runtime`, read by everyone else. One thread only."""

    def __init__(self) -> None:
        self.connected = False
        self.hello: dict[str, Any] = {}
        self.status: dict[str, Any] = dict(LOST)
        self.pose: dict[str, Any] | None = None
        self.landmarks: list[list[float]] = []
        self.resolution_m: float | None = None
        self.tiles: dict[Place, bytes] = {}
        self.track: list[list[float]] = []
        self.track_number = 0
        self.images: dict[str, bytes] = {}
        self.checks: list[dict[str, str]] = []
        self.drawn: dict[str, Any] = {}  # rooms, annotations, snapshots, parts: `ledger` fills it
        self.map_version = 0
        self._packed: dict[frozenset[Place], bytes] = {}
        self._mailboxes: set[Mailbox] = set()

    # ------------------------------------------------------------------ readers

    def subscribe(self) -> Mailbox:
        """A mailbox in which everything is new."""
        box = Mailbox(
            {"hello", "status", "pose", "track", "landmarks", "map", "drawn"}, set(self.tiles)
        )
        box.bell.set()
        self._mailboxes.add(box)
        return box

    def unsubscribe(self, box: Mailbox) -> None:
        """Tell this reader no more."""
        self._mailboxes.discard(box)

    def packed(self, places: frozenset[Place]) -> bytes:
        """These tiles, compressed; readers that keep pace share the work."""
        if places not in self._packed:
            if len(self._packed) > 64:
                self._packed.clear()
            tiles = [(p, self.tiles.get(p, bytes(stream.TILE_BYTES))) for p in places]
            self._packed[places] = stream.pack_tiles(tiles)
        return self._packed[places]

    # ------------------------------------------------------------------ the robot's words

    def take(self, kind: bytes, payload: bytes) -> None:
        """One message of the stream. Raises StreamError for one that makes no sense."""
        try:
            if kind == stream.JSON:
                self._words(json.loads(payload))
            elif kind == stream.TILES:
                self._cells(stream.unpack_tiles(payload))
            elif kind == stream.IMAGE:
                eye = stream.EYES[payload[0]]
                self.images[eye] = payload[1:]
                self._tell(f"image-{eye}")
        except (KeyError, TypeError, ValueError, IndexError, zlib.error) as error:
            raise stream.StreamError(f"the robot's message makes no sense ({error})") from None

    def lost(self) -> None:
        """The runtime has gone; what is known of the floor stays to be looked at."""
        self.connected = False
        self.status = {**LOST, "t_s": self.status.get("t_s", 0.0)}
        self.images.clear()
        self._tell("status", "hello")

    def edited(self) -> None:
        """Somebody has changed what is drawn on the map; it is to be asked for again."""
        self._tell("edited")

    def draw(self, drawn: dict[str, Any]) -> None:
        """What is drawn on the map, and how worn the parts are."""
        if drawn != self.drawn:
            self.drawn = drawn
            self._tell("drawn")

    def has(self, verb: str) -> bool:
        """Whether the robot knows this request."""
        return verb in self.hello.get("verbs", ())

    def _words(self, words: dict[str, Any]) -> None:
        kind = words["type"]
        if kind == "hello":
            if words["protocol"] != stream.PROTOCOL:
                raise ValueError(f"protocol {words['protocol']}, not {stream.PROTOCOL}")
            self.connected, self.hello = True, words
            # What was known may be another life's: begin with a clean sheet.
            gone = set(self.tiles)
            self.tiles.clear()
            self._packed.clear()
            for box in self._mailboxes:
                box.tiles |= gone
            self._tell("map")
        elif kind in ("status", "pose"):
            setattr(self, kind, words)
        elif kind == "landmarks":
            self.landmarks = words["points"]
        elif kind == "map":
            self.resolution_m = float(words["resolution_m"])
        elif kind == "track":
            self._crumbs(words["number"], words["first"], words["xy_m"])
        elif kind == "check":
            self.checks = words["checks"]
        self._tell(kind)

    def _crumbs(self, number: int, first: int, points: list[list[float]]) -> None:
        if number != self.track_number or first == 0:
            self.track_number, self.track = number, []
        if len(self.track) + len(points) > MAX_TRACK:
            raise ValueError("the track is too long")
        del self.track[first:]
        self.track += points

    def _cells(self, tiles: dict[Place, bytes]) -> None:
        if len(self.tiles) + len(tiles) > MAX_TILES:
            raise ValueError("the map is too large")
        self.tiles |= tiles
        self.map_version += 1
        self._packed.clear()
        for box in self._mailboxes:
            box.tiles |= tiles.keys()
        self._tell("tiles")

    def _tell(self, *kinds: str) -> None:
        for box in self._mailboxes:
            box.kinds |= set(kinds)
            box.bell.set()
