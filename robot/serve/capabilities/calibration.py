"""Whether the eyes are known well."""

from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from robot.serve.capabilities.check import ANSWER
from robot.serve.capability import Capability, Operation, Robot

CODES = ("calibration", "sync", "camera", "imu")


async def read(robot: Robot, request: Request) -> Response:
    """What the check has to say about the sensors' calibration."""
    found = [check for check in await robot.runtime.check() if check["code"] in CODES]
    return JSONResponse({"checks": found})


CAPABILITY = Capability(
    "calibration",
    "Calibration",
    "Whether there is a calibration, how well it fits, and what to do; `sweeper calibrate` makes "
    "one.",
    (Operation("GET", "/calibration", "Findings about it.", read, ANSWER, refusals=(503,)),),
    has=lambda robot: robot.world.connected,
)
