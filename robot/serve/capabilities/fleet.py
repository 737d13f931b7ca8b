"""Other robots on the same MQTT broker."""

from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from robot.serve.capability import Capability, Operation, Robot, Schema

ANSWER: Schema = {
    "type": "object",
    "required": ["robots"],
    "properties": {"robots": {"type": "array", "items": {"type": "object"}}},
}


async def read(robot: Robot, request: Request) -> Response:
    """What each robot last said about itself."""
    robots = [{"id": robot_id, **said} for robot_id, said in sorted(robot.fleet.items())]
    return JSONResponse({"robots": robots})


CAPABILITY = Capability(
    "fleet",
    "Fleet",
    "All robots that speak to the same MQTT broker: name, state, battery, reason.",
    (Operation("GET", "/fleet", "All robots on the broker.", read, ANSWER),),
    has=lambda robot: robot.has_fleet,
)
