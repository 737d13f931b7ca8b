"""What the robot has to say about its own health."""

from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from robot.serve.capability import Capability, Operation, Robot, Schema

ANSWER: Schema = {
    "type": "object",
    "required": ["checks"],
    "properties": {
        "checks": {
            "type": "array",
            "items": {
                "type": "object",
                "required": ["code", "level", "cause", "remedy"],
                "properties": {
                    "code": {"type": "string"},
                    "level": {"type": "string", "enum": ["ok", "warn", "error"]},
                    "cause": {"type": "string"},
                    "remedy": {"type": "string"},
                },
            },
        }
    },
}


async def read(robot: Robot, request: Request) -> Response:
    """Findings with cause and remedy."""
    return JSONResponse({"checks": await robot.runtime.check()})


CAPABILITY = Capability(
    "check",
    "Check",
    "Findings about the running robot, each with its cause and remedy.",
    (Operation("GET", "/check", "Findings, with remedies.", read, ANSWER, refusals=(503,)),),
    has=lambda robot: robot.world.connected,
)
