"""The way of the present run."""

from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from robot.serve.capability import Capability, Operation, Robot, Schema

ANSWER: Schema = {
    "type": "object",
    "required": ["xy_m"],
    "properties": {
        "xy_m": {
            "type": "array",
            "items": {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2},
        }
    },
}


async def read(robot: Robot, request: Request) -> Response:
    """Where the robot has been since the last start."""
    return JSONResponse({"xy_m": robot.world.track})


CAPABILITY = Capability(
    "track",
    "Track",
    "Where the robot has driven since the last start, metres in `world`.",
    (Operation("GET", "/track", "The way since the last start.", read, ANSWER),),
    has=lambda robot: bool(robot.world.hello),
)
