"""The points by which the robot knows where it is."""

from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from robot.serve.capability import Capability, Operation, Robot, Schema

ANSWER: Schema = {
    "type": "object",
    "required": ["points"],
    "properties": {
        "points": {
            "type": "array",
            "items": {
                "type": "object",
                "required": ["x_m", "y_m", "cov"],
                "properties": {
                    "x_m": {"type": "number"},
                    "y_m": {"type": "number"},
                    "cov": {"type": "array", "items": {"type": "number"}},
                },
            },
        }
    },
}


async def read(robot: Robot, request: Request) -> Response:
    """Every landmark with its covariance (xx, xy, yy)."""
    points = [{"x_m": x, "y_m": y, "cov": cov} for x, y, *cov in robot.world.landmarks]
    return JSONResponse({"points": points})


CAPABILITY = Capability(
    "landmarks",
    "Landmarks",
    "The points by which the robot knows where it is, each with its uncertainty.",
    (Operation("GET", "/landmarks", "Landmarks with covariance (xx, xy, yy).", read, ANSWER),),
    has=lambda robot: bool(robot.world.landmarks),
)
