"""Something to send along when asking for help."""

import asyncio

from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from robot.serve.capability import Capability, Operation, Robot
from robot.serve.made import made

PATIENCE_S = 120.0
_one_at_a_time = asyncio.Semaphore(1)


async def read(robot: Robot, request: Request) -> Response:
    """Made by a process of its own, which leaves the running robot's devices alone."""
    if _one_at_a_time.locked():
        return JSONResponse({"error": "a bundle is being made already; wait for it"}, 429)
    words = ["check", "--beside"]
    words += ["--config", str(robot.config)] if robot.config is not None else []
    async with _one_at_a_time:
        data = await made(words, "--bundle", "bundle.tar.gz", PATIENCE_S)
    if data is None:
        return JSONResponse({"error": "the bundle could not be made; see the journal"}, 503)
    name = f"sweeper-{robot.robot_id}-support.tar.gz"
    headers = {"content-disposition": f'attachment; filename="{name}"'}
    return Response(data, media_type="application/gzip", headers=headers)


CAPABILITY = Capability(
    "bundle",
    "Support bundle",
    "Findings, settings, versions, journal and summaries as a .tar.gz: no secrets, no images.",
    (
        Operation(
            "GET", "/bundle", "Make one and download it.", read, media="application/gzip",
            refusals=(503,),
        ),
    ),
)  # fmt: skip
