"""What the robot sees."""

from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from robot.body.talk.stream import EYES
from robot.serve.capability import Capability, Operation, Parameter, Robot


async def read(robot: Robot, request: Request) -> Response:
    """A fresh picture; pictures are made only when someone asks, and never kept."""
    eye = request.path_params["eye"]
    picture = await robot.runtime.picture(eye) if eye in EYES else None
    if picture is None:
        return JSONResponse({"error": f"there is no picture {eye!r} now"}, 404)
    return Response(picture, media_type="image/jpeg")


CAPABILITY = Capability(
    "camera",
    "Camera",
    "The left image and the disparity, live, while someone looks.",
    (
        Operation(
            "GET", "/camera/{eye}", "A picture of this moment.", read, media="image/jpeg",
            parameters=(Parameter("eye", "Which one.", {"type": "string", "enum": list(EYES)}),),
            refusals=(404,),
        ),
    ),
    has=lambda robot: bool(robot.world.hello.get("eyes")),
)  # fmt: skip
