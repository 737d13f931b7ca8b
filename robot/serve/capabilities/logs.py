"""What the robot has lived through lately: segments of its log, kept in memory."""

import asyncio

from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from robot.serve.capability import Capability, Operation, Parameter, Robot, Schema
from robot.serve.runs import send_file

ANSWER: Schema = {
    "type": "object",
    "required": ["segments"],
    "properties": {
        "segments": {
            "type": "array",
            "items": {
                "type": "object",
                "required": ["name", "bytes", "ended_s"],
                "properties": {
                    "name": {"type": "string"},
                    "bytes": {"type": "integer"},
                    "ended_s": {"type": "number", "description": "Unix time of the last entry"},
                },
            },
        }
    },
}


async def listing(robot: Robot, request: Request) -> Response:
    """The newest first; the newest of all is still growing."""
    return JSONResponse({"segments": await asyncio.to_thread(robot.ring.newest)})


async def read(robot: Robot, request: Request) -> Response:
    """One segment: a whole log of its own."""
    path = await asyncio.to_thread(robot.ring.file, request.path_params["file"])
    if path is None:
        return JSONResponse({"error": "there is no such segment (any more)"}, 404)
    return await asyncio.to_thread(send_file, path, path.name)


CAPABILITY = Capability(
    "logs",
    "Logs of the last minutes",
    "Segments of the log that is kept in memory, each a whole MCAP file for Foxglove.",
    (
        Operation("GET", "/logs", "Segments, the newest first.", listing, ANSWER),
        Operation(
            "GET", "/logs/{file}", "One segment.", read, media="application/octet-stream",
            parameters=(Parameter("file", "Its name.", {"type": "string"}),), refusals=(404,),
        ),
    ),
    has=lambda robot: robot.ring.present,
)  # fmt: skip
