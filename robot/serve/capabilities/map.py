"""The floor as the robot knows it."""

import asyncio

from starlette.requests import Request
from starlette.responses import Response

from robot.serve.capability import Capability, Operation, Robot, Sensor
from robot.serve.picture import map_png


async def picture(robot: Robot, request: Request) -> Response:
    """A PNG, north is y."""
    world = robot.world
    png = await asyncio.to_thread(map_png, dict(world.tiles), list(world.track), world.resolution_m)
    return Response(png, media_type="image/png")


CAPABILITY = Capability(
    "map",
    "Map",
    "The floor: free, swept, occupied. The page gets it live, as changes.",
    (
        Operation(
            "GET", "/map.png", "The map with the run's track, as a picture.", picture,
            media="image/png",
        ),
    ),
    has=lambda robot: robot.world.resolution_m is not None,
    sensors={"map": Sensor("image", {"name": "Map", "content_type": "image/png"})},
)  # fmt: skip
