"""Furniture by kind. Each piece stands at a pose with its front along x; size is depth, width,
height in metres."""

from __future__ import annotations

from collections.abc import Callable

from robot.geometry.se2 import SE2
from robot.sim.building import Building

Size = tuple[float, float, float]
# (building, pose, size or None, texture or "", bottom_m)
Make = Callable[[Building, SE2, Size | None, str, float], None]

FRAME_M, RAIL_M = 0.05, 0.08  # of a glass door or showcase


def _block(default: Size, texture: str, front: str = "") -> Make:
    """One box; a texture given in the scene covers its front too."""

    def make(building: Building, pose: SE2, size: Size | None, name: str, bottom_m: float) -> None:
        building.box(
            pose,
            size or default,
            name or texture,
            bottom_m=bottom_m,
            front="" if name else front,
        )

    return make


def _seat(default: Size, texture: str) -> Make:
    """Base, back and arms: a sofa or an armchair."""

    def make(building: Building, pose: SE2, size: Size | None, name: str, bottom_m: float) -> None:
        depth, width, height = size or default
        name = name or texture
        half = 0.5 * height
        building.box(pose, (depth, width, half), name, bottom_m=bottom_m)
        back = pose @ SE2(-0.4 * depth, 0.0, 0.0)
        building.box(back, (0.2 * depth, width, half), name, bottom_m=bottom_m + half)
        for side in (0.5, -0.5):
            arm = pose @ SE2(0.1 * depth, side * (width - 0.14), 0.0)
            building.box(arm, (0.8 * depth, 0.14, 0.2), name, bottom_m=bottom_m + half)

    return make


def _on_legs(default: Size, top_m: float, leg_m: float, texture: str, back_m: float = 0.0) -> Make:
    """A top on four legs, the robot drives beneath where it fits; `back_m`: a chair's back."""

    def make(building: Building, pose: SE2, size: Size | None, name: str, bottom_m: float) -> None:
        depth, width, height = size or default
        name = name or texture
        building.legs(pose, (depth, width, height - top_m), leg_m, name)
        building.box(pose, (depth, width, top_m), name, bottom_m=height - top_m)
        if back_m:
            back = pose @ SE2(-0.5 * depth + 0.02, 0.0, 0.0)
            building.box(back, (0.03, width, back_m), name, bottom_m=height + 0.08)

    return make


def _rug(building: Building, pose: SE2, size: Size | None, name: str, bottom_m: float) -> None:
    """So flat that it is driven over."""
    depth, width, _ = size or (1.2, 1.7, 0.0)
    building.box(pose, (depth, width, 0.006), name or "oriental", bottom_m=bottom_m)


def _plant(building: Building, pose: SE2, size: Size | None, name: str, bottom_m: float) -> None:
    depth, width, height = size or (0.28, 0.28, 0.9)
    pot = 0.35 * height
    building.box(pose, (depth, width, pot), name or "brick:4", bottom_m=bottom_m)
    leaves = (1.4 * depth, 1.4 * width, 0.6 * height)
    turned = pose @ SE2(0.0, 0.0, 0.6)
    building.box(turned, leaves, "leaves", bottom_m=bottom_m + pot + 0.05 * height)


def _lamp(building: Building, pose: SE2, size: Size | None, name: str, bottom_m: float) -> None:
    """A standing lamp: foot, pole and shade."""
    depth, width, height = size or (0.28, 0.28, 1.4)
    building.box(pose, (depth, width, 0.03), name or "metal:4", bottom_m=bottom_m)
    building.box(pose, (0.03, 0.03, height - 0.25), name or "metal:4", bottom_m=bottom_m + 0.03)
    building.box(pose, (depth, width, 0.22), "plain:6", bottom_m=bottom_m + height - 0.22)


def _glass(building: Building, pose: SE2, size: Size | None, name: str, bottom_m: float) -> None:
    """A pane in a frame: solid, but nothing between posts and rails is seen."""
    depth, width, height = size or (0.06, 1.6, 2.0)
    name = name or "metal:6"
    for at in (0.5, -0.5):
        post = pose @ SE2(0.0, at * (width - FRAME_M), 0.0)
        building.box(post, (depth, FRAME_M, height), name, bottom_m=bottom_m)
    building.box(pose, (depth, width, RAIL_M), name, bottom_m=bottom_m)
    building.box(pose, (depth, width, FRAME_M), name, bottom_m=bottom_m + height - FRAME_M)


def _glass_table(
    building: Building, pose: SE2, size: Size | None, name: str, bottom_m: float
) -> None:
    """Four thin legs under a top that nobody sees."""
    depth, width, height = size or (0.8, 1.2, 0.45)
    building.legs(pose, (depth, width, height), 0.03, name or "metal:8")


FURNITURE: dict[str, Make] = {
    "box": _block((0.4, 0.4, 0.4), "wood"),
    "cabinet": _block((0.4, 0.8, 0.9), "wood:2", "cabinet"),
    "drawers": _block((0.45, 0.9, 0.8), "wood:3", "drawers"),
    "shelf": _block((0.3, 0.9, 1.8), "dark_wood", "books"),
    "kitchen": _block((0.6, 1.8, 0.9), "metal", "cabinet:5"),
    "bed": _block((2.0, 1.4, 0.45), "fabric:6"),
    "picture": _block((0.03, 0.6, 0.45), "picture"),
    "window": _block((0.02, 1.0, 1.0), "window"),
    "curtain": _block((0.05, 0.4, 2.2), "curtain"),
    "sofa": _seat((0.85, 1.8, 0.8), "fabric:1"),
    "armchair": _seat((0.75, 0.75, 0.8), "leather"),
    "table": _on_legs((0.8, 1.2, 0.74), 0.04, 0.06, "wood:4"),
    "chair": _on_legs((0.42, 0.42, 0.46), 0.04, 0.04, "dark_wood:2", back_m=0.38),
    "rug": _rug,
    "plant": _plant,
    "lamp": _lamp,
    "glass": _glass,
    "glass_table": _glass_table,
}
