"""Tells watchers what the robot sees and does: one thread, never the loop's."""

from __future__ import annotations

import contextlib
import json
import select
import socket
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np

from robot.body.talk import stream
from robot.body.talk.outlook import Outlook
from robot.body.talk.shown import coloured, cut_tiles, jpeg, landmark_rows, temperature_c
from robot.body.talk.stream import Place, batches, frame, pack_tiles
from robot.body.talk.watcher import Watcher
from robot.messages import Grid

MAX_WATCHERS = 4
BEAT_S = 0.05
LOOK_S = 3.0  # for so long after the last wish, pictures are sent
PICTURE_EVERY_S = 0.3

Looked = tuple[np.ndarray, np.ndarray]  # left (h, w) uint8, disparity (h, w) float32, NaN: none
Check = Callable[[], list[dict[str, str]]]


class Publisher(threading.Thread):
    """Owns the watchers. `adopt` may be called from the loop; everything else is its thread's."""

    def __init__(
        self, outlook: Outlook, looked: Callable[[], Looked | None], check: Check | None = None
    ) -> None:
        super().__init__(name="publisher", daemon=True)
        self._outlook, self._looked, self._check = outlook, looked, check
        self._new: deque[socket.socket] = deque()
        self._watchers: list[Watcher] = []
        self._stopping = False
        self._ring, self._bell = socket.socketpair()
        self._ring.setblocking(False)
        self._bell.setblocking(False)
        self._tiles: dict[Place, bytes] = {}
        self._last: dict[str, bytes] = {}
        self._pictured_s = 0.0
        self._pictured: Looked | None = None
        outlook.wake = self.wake

    # ------------------------------------------------------------------ the loop's side

    def adopt(self, connection: socket.socket) -> bool:
        """Take over a watcher's connection; False when there are too many."""
        if len(self._watchers) + len(self._new) >= MAX_WATCHERS:
            return False
        self._new.append(connection)
        self._outlook.wanted = True
        self.wake()
        return True

    def wake(self) -> None:
        """Something happened that should not wait for the next beat."""
        with contextlib.suppress(OSError):
            self._ring.send(b"!")

    def stop(self) -> None:
        """End the thread and hang up on everyone."""
        self._stopping = True
        self.wake()
        if self.is_alive():
            self.join(timeout=2.0)

    # ------------------------------------------------------------------ the thread

    def run(self) -> None:
        """Thread body."""
        while not self._stopping:
            self._wait()
            while self._new:
                self._watchers.append(Watcher(self._new.popleft()))
            self._outlook.wanted = bool(self._watchers)
            for watcher in self._watchers:
                for line in watcher.lines():
                    self._obey(watcher, line)
            self._publish()
            for watcher in self._watchers:
                watcher.send()
            for watcher in [w for w in self._watchers if w.gone]:
                self._watchers.remove(watcher)
                watcher.connection.close()
        for watcher in self._watchers:
            watcher.connection.close()
        self._ring.close()
        self._bell.close()

    def _wait(self) -> None:
        """Until the bell rings, or the next beat."""
        ready, _, _ = select.select([self._bell], [], [], BEAT_S)
        if ready:
            with contextlib.suppress(OSError):
                self._bell.recv(64)

    def _obey(self, watcher: Watcher, line: bytes) -> None:
        try:
            wish = json.loads(line)
            eyes = [eye for eye in wish.get("look", []) if eye in stream.EYES]
            check = wish.get("check") is True
        except (ValueError, AttributeError, TypeError, RecursionError):
            watcher.gone = True
            return
        for eye in eyes:
            watcher.look_until_s[eye] = time.monotonic() + LOOK_S
        if check and self._check is not None:
            watcher.put(_json({"type": "check", "checks": self._check()}))

    def _publish(self) -> None:
        news = self._outlook.news()
        fresh: list[bytes] = []
        changed: dict[Place, bytes] = {}
        for kind, value in news.items():
            if kind == "view":
                changed = self._changed(*value)
            else:
                self._last[kind] = self._worded(kind, value)
                fresh.append(self._last[kind])
        packed = [frame(stream.TILES, pack_tiles(batch)) for batch in batches(changed)]
        for watcher in self._watchers:
            if watcher.greeted:
                for message in fresh + packed:
                    watcher.put(message)
            else:
                self._greet(watcher)
            self._track(watcher)
        self._pictures()

    def _greet(self, watcher: Watcher) -> None:
        watcher.greeted = True
        picture = self._looked() is not None
        watcher.put(_json({**self._outlook.hello, "eyes": list(stream.EYES) if picture else []}))
        for message in self._last.values():
            watcher.put(message)
        for batch in batches(self._tiles):
            watcher.put(frame(stream.TILES, pack_tiles(batch)))

    def _track(self, watcher: Watcher) -> None:
        number, first, points = self._outlook.crumbs(*watcher.track)
        if points or number != watcher.track[0]:
            watcher.put(_json({"type": "track", "number": number, "first": first, "xy_m": points}))
            watcher.track = (number, first + len(points))

    def _worded(self, kind: str, value: Any) -> bytes:
        if kind == "landmarks":
            return _json({"type": "landmarks", "points": landmark_rows(value)})
        if kind == "status":
            return _json({**value, "temperature_c": temperature_c()})
        return _json(value)

    def _changed(self, grid: Grid, covered: np.ndarray) -> dict[Place, bytes]:
        """Tiles that differ from what was published; a tile that is gone becomes unknown."""
        now = cut_tiles(grid, covered)
        if not now and not self._tiles:
            return {}
        empty = bytes(stream.TILE_BYTES)
        changed = {place: cells for place, cells in now.items() if self._tiles.get(place) != cells}
        changed |= {place: empty for place in self._tiles.keys() - now.keys()}
        if "map" not in self._last:
            self._last = {"map": _json({"type": "map", "resolution_m": grid.resolution_m})} | (
                self._last
            )
            for watcher in self._watchers:
                if watcher.greeted:
                    watcher.put(self._last["map"])
        self._tiles = now
        return changed

    def _pictures(self) -> None:
        now_s = time.monotonic()
        if now_s - self._pictured_s < PICTURE_EVERY_S:
            return
        looking = {
            eye: [w for w in self._watchers if w.look_until_s[eye] > now_s] for eye in stream.EYES
        }
        looked = self._looked()
        if not any(looking.values()) or looked is None or looked is self._pictured:
            return
        self._pictured_s, self._pictured = now_s, looked
        for number, (eye, watchers) in enumerate(looking.items()):
            if watchers:
                image = looked[0] if eye == "left" else coloured(looked[1])
                message = frame(stream.IMAGE, bytes([number]) + jpeg(image))
                for watcher in watchers:
                    watcher.put(message)


def _json(value: dict[str, Any]) -> bytes:
    return frame(stream.JSON, json.dumps(value, allow_nan=False).encode())
