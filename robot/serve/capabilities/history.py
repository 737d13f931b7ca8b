"""Past runs, with their maps and logs."""

import asyncio

from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from robot.serve.capability import Capability, Operation, Parameter, Robot, Schema
from robot.serve.runs import FILES, MAX_LISTED, send_file

ANSWER: Schema = {
    "type": "object",
    "required": ["runs"],
    "properties": {
        "runs": {
            "type": "array",
            "items": {
                "type": "object",
                "required": ["id", "files", "summary"],
                "properties": {
                    "id": {"type": "string"},
                    "files": {"type": "object"},
                    "summary": {"type": ["object", "null"]},
                },
            },
        }
    },
}


async def listing(robot: Robot, request: Request) -> Response:
    """The newest runs first."""
    try:
        limit = int(request.query_params.get("limit", "20"))
    except ValueError:
        limit = 0
    if not 1 <= limit <= MAX_LISTED:
        return JSONResponse({"error": f"limit must be a number from 1 to {MAX_LISTED}"}, 400)
    return JSONResponse({"runs": await asyncio.to_thread(robot.runs.newest, limit)})


async def read(robot: Robot, request: Request) -> Response:
    """One file of one run."""
    run, name = request.path_params["run"], request.path_params["file"]
    path = await asyncio.to_thread(robot.runs.file, run, name)
    if path is None:
        return JSONResponse({"error": "there is no such run or file"}, 404)
    return await asyncio.to_thread(send_file, path, f"{run}-{name}")


CAPABILITY = Capability(
    "history",
    "History",
    "Past runs: figures, map picture, track, and the log to download.",
    (
        Operation(
            "GET", "/runs", "Past runs, the newest first.", listing, ANSWER,
            parameters=(
                Parameter(
                    "limit", "How many.",
                    {"type": "integer", "minimum": 1, "maximum": MAX_LISTED}, "query",
                ),
            ),
        ),
        Operation(
            "GET", "/runs/{run}/{file}", "One file of a run.", read,
            media="application/octet-stream",
            parameters=(
                Parameter("run", "Its id.", {"type": "string"}),
                Parameter(
                    "file", "One of the names that were listed.",
                    {"type": "string", "examples": sorted(FILES)},
                ),
            ),
            refusals=(404,),
        ),
    ),
    has=lambda robot: robot.runs.present,
)  # fmt: skip
