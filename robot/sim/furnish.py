"""Furnishing a room by chance, so that a robot can still get round everything.

Between any two pieces, and between a piece and a wall, there is either no gap at all or one that
the robot passes with a hand's breadth to spare. Doors and the dock's approach stay free.
"""

from __future__ import annotations

import math

import numpy as np

from robot.sim.floor_plan import HALF_WALL_M, Rect
from robot.sim.scene_file import FurnitureTable

GAP_M = 0.02  # behind a piece, off the skirting board
PASS_M = 0.56  # the least width of a way past something
TRIES = 14
CORNER_CHANCE = 0.55
WALLS = {0.0: (-1, 0), 90.0: (0, -1), 180.0: (1, 0), -90.0: (0, 1)}  # yaw: where the wall is
Range = tuple[float, float]

# Against a wall: kind, depth, width, height (each from, to), textures.
Piece = tuple[str, Range, Range, Range, tuple[str, ...]]
SOFA: Piece = ("sofa", (0.8, 0.95), (1.5, 2.2), (0.75, 0.85), ("fabric", "black", "leather"))
ARMCHAIR: Piece = ("armchair", (0.7, 0.8), (0.7, 0.8), (0.75, 0.85), ("leather", "fabric"))
SHELF: Piece = ("shelf", (0.28, 0.36), (0.7, 1.4), (1.2, 2.0), ("",))
DRAWERS: Piece = ("drawers", (0.4, 0.5), (0.7, 1.1), (0.7, 0.9), ("", "black"))
CABINET: Piece = ("cabinet", (0.35, 0.6), (0.8, 1.6), (0.9, 2.0), ("", "black"))
BED: Piece = ("bed", (1.9, 2.05), (0.9, 1.6), (0.4, 0.5), ("fabric",))
COUNTER: Piece = ("kitchen", (0.58, 0.62), (1.4, 2.4), (0.88, 0.92), ("",))
DESK: Piece = ("table", (0.75, 0.8), (1.5, 1.7), (0.72, 0.76), ("wood", "black"))
TUB: Piece = ("box", (0.7, 0.8), (1.5, 1.7), (0.5, 0.6), ("plain",))
BASIN: Piece = ("cabinet", (0.4, 0.5), (0.5, 0.8), (0.8, 0.9), ("",))
PLANT: Piece = ("plant", (0.26, 0.32), (0.26, 0.32), (0.7, 1.2), ("",))
LAMP: Piece = ("lamp", (0.26, 0.3), (0.26, 0.3), (1.3, 1.6), ("",))
GLASS: Piece = ("glass", (0.05, 0.06), (1.2, 1.8), (1.9, 2.1), ("",))

ROOMS: dict[str, tuple[Piece, ...]] = {
    "living": (SOFA, SHELF, GLASS, ARMCHAIR, DRAWERS, LAMP, PLANT),
    "bedroom": (BED, CABINET, DRAWERS, PLANT),
    "kitchen": (COUNTER, CABINET, GLASS),
    "study": (DESK, SHELF, CABINET, LAMP),
    "bath": (TUB, BASIN),
}
DINING = {"living": 0.5, "kitchen": 0.7}  # chance of a table with chairs
RUG = {"living": 0.7, "bedroom": 0.5, "study": 0.3}
MOST_FILLED = 0.34  # share of a room that furniture takes


class Furnisher:
    """Puts pieces into one room; `free` are places that must stay empty."""

    def __init__(self, rng: np.random.Generator, room: Rect, free: list[Rect]) -> None:
        self._rng = rng
        self._room = room.grown(-HALF_WALL_M)
        self._free = free
        self.solid: list[Rect] = []
        self.pieces: list[FurnitureTable] = []

    def furnish(self, role: str) -> None:
        """All that belongs into a room of this kind and finds a place."""
        for piece in ROOMS[role]:
            self._against_a_wall(piece)
        if self._rng.random() < DINING.get(role, 0.0):
            self._dining()
        if self._rng.random() < RUG.get(role, 0.0):
            self._rug()
        self._pictures()

    # ------------------------------------------------------------------ places

    def _gap_kept(self, rect: Rect) -> bool:
        """True if a piece there leaves no gap that is neither closed nor wide enough."""
        room = self._room
        if not rect.within(room) or any(rect.meets(zone) for zone in self._free):
            return False
        sides = (rect.x0 - room.x0, rect.y0 - room.y0, room.x1 - rect.x1, room.y1 - rect.y1)
        if any(GAP_M + 0.02 < side < PASS_M for side in sides):
            return False
        filled = sum(solid.area_m2 for solid in self.solid) + rect.area_m2
        wide = rect.grown(PASS_M)
        apart = not any(wide.meets(solid) for solid in self.solid)
        return apart and filled <= MOST_FILLED * room.area_m2

    def _uniform(self, span: Range) -> float:
        return round(float(self._rng.uniform(*span)), 2)

    def _texture(self, names: tuple[str, ...]) -> str:
        name = names[self._rng.integers(len(names))]
        return f"{name}:{self._rng.integers(50)}" if name else ""

    def _put(self, kind: str, at: tuple[float, float], yaw: float, **more: object) -> None:
        place = (round(at[0], 3), round(at[1], 3))
        self.pieces.append(FurnitureTable(kind=kind, at=place, yaw_deg=yaw, **more))  # type: ignore[arg-type]

    def _against_a_wall(self, piece: Piece) -> None:
        kind, depths, widths, heights, textures = piece
        for _ in range(TRIES):
            depth, width = self._uniform(depths), self._uniform(widths)
            yaw = list(WALLS)[self._rng.integers(4)]
            rect = self._at_wall(yaw, depth, width)
            if rect is not None and self._gap_kept(rect):
                size = (depth, width, self._uniform(heights))
                middle = ((rect.x0 + rect.x1) / 2.0, (rect.y0 + rect.y1) / 2.0)
                self._put(kind, middle, yaw, size=size, texture=self._texture(textures))
                self.solid.append(rect)
                return

    def _at_wall(self, yaw: float, depth: float, width: float) -> Rect | None:
        """With its back to the wall behind `yaw`, in a corner or anywhere along it."""
        room, (wx, wy) = self._room, WALLS[yaw]
        low, high = (room.y0, room.y1) if wx else (room.x0, room.x1)
        low, high = low + GAP_M, high - GAP_M - width
        if high < low:
            return None
        along = float(self._rng.uniform(low, high))
        if self._rng.random() < CORNER_CHANCE:
            along = low if self._rng.random() < 0.5 else high
        if wx:
            x0 = room.x0 + GAP_M if wx < 0 else room.x1 - GAP_M - depth
            return Rect(x0, along, x0 + depth, along + width)
        y0 = room.y0 + GAP_M if wy < 0 else room.y1 - GAP_M - depth
        return Rect(along, y0, along + width, y0 + depth)

    def _somewhere(self, wide: float, deep: float) -> Rect | None:
        room = self._room
        if room.x1 - room.x0 < wide or room.y1 - room.y0 < deep:
            return None
        x = float(self._rng.uniform(room.x0, room.x1 - wide))
        y = float(self._rng.uniform(room.y0, room.y1 - deep))
        return Rect(x, y, x + wide, y + deep)

    def _dining(self) -> None:
        """A table, chairs pushed half under its long sides, room to go round all of it."""
        width, depth, under = (1.0, 1.6)[self._rng.integers(2)], 0.8, 0.18
        chair, top = 0.42, 2 * 0.24 + 0.8
        for _ in range(TRIES):
            turned = bool(self._rng.random() < 0.5)
            size = (width, top) if turned else (top, width)
            rect = self._somewhere(*size)
            if rect is None or not self._gap_kept(rect):
                continue
            x, y = (rect.x0 + rect.x1) / 2.0, (rect.y0 + rect.y1) / 2.0
            kind = "table" if self._rng.random() < 0.8 else "glass_table"
            yaw = 90.0 if turned else 0.0
            self._put(kind, (x, y), yaw, size=(depth, width, 0.74))
            off = depth / 2.0 + chair / 2.0 - under
            for side in (1.0, -1.0) if self._rng.random() < 0.7 else (1.0,):
                at = (x, y + side * off) if turned else (x + side * off, y)
                faces = (-90.0 if side > 0 else 90.0) if turned else (180.0 if side > 0 else 0.0)
                self._put("chair", at, faces)
            self.solid.append(rect)
            return

    def _rug(self) -> None:
        deep, wide = self._uniform((0.9, 1.3)), self._uniform((1.2, 2.0))
        rect = self._somewhere(deep, wide)
        if rect is not None and not any(rect.meets(solid) for solid in self.solid):
            middle = ((rect.x0 + rect.x1) / 2.0, (rect.y0 + rect.y1) / 2.0)
            self._put("rug", middle, 0.0, size=(deep, wide, 0.0))

    def _pictures(self) -> None:
        """On some walls, too high to be bumped into, and not across a door."""
        room = self._room
        for yaw, (wx, wy) in WALLS.items():
            x = room.x0 if wx < 0 else room.x1 if wx > 0 else self._uniform((room.x0, room.x1))
            y = room.y0 if wy < 0 else room.y1 if wy > 0 else self._uniform((room.y0, room.y1))
            x += 0.02 * math.cos(math.radians(yaw))
            y += 0.02 * math.sin(math.radians(yaw))
            place = Rect(x, y, x, y).grown(0.4)
            if self._rng.random() < 0.7 and not any(place.meets(zone) for zone in self._free):
                texture = f"picture:{self._rng.integers(100)}"
                self._put("picture", (x, y), yaw, bottom=0.3, texture=texture)
