"""Calibrating the cameras while somebody looks: the runtime finds the board in its own pictures."""

import asyncio

from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from robot.serve.capability import (
    Capability,
    Operation,
    Robot,
    Schema,
    has_verbs,
    listed,
    listing_operation,
    verb_operation,
)
from robot.serve.made import made

PATIENCE_S = 60.0
BOARD: Schema = {
    "type": "string",
    "minLength": 1,
    "maxLength": 40,
    "description": "inner corners and the measured size of a square, such as charuco:9x6:24mm",
}
FLAG: Schema = {"type": "boolean"}
NUMBER: Schema = {"type": ["number", "null"]}


_one_at_a_time = asyncio.Semaphore(1)
_drawn: dict[str, bytes] = {}  # the default board, once it was wanted


async def board(robot: Robot, request: Request) -> Response:
    """The default board for the printer."""
    async with _one_at_a_time:
        if "board" not in _drawn:
            picture = await made(["calibrate", "board"], "--out", "board.png", PATIENCE_S)
            if picture is None:
                return JSONResponse({"error": "the board could not be drawn; see the journal"}, 503)
            _drawn["board"] = picture
    return Response(_drawn["board"], media_type="image/png")


CAPABILITY = Capability(
    "calibrate",
    "Calibrate the cameras",
    "Look for a calibration board, show how well the image is covered and how far the eyes' rows "
    "are apart, and keep the result.",
    (
        listing_operation(
            "calibration show", "/calibration/views", "How far it is; counts by cell of the image.",
            listed(
                possible=FLAG, running=FLAG, board={"type": "string"}, saved={"type": "string"},
                wanted=NUMBER, max_rms_px=NUMBER, max_epipolar_px=NUMBER,
            ),
        ),
        verb_operation(
            "calibration begin", "/calibration/begin", "Look for a board.", {"board": BOARD},
            ("board",),
        ),
        verb_operation("calibration save", "/calibration/save", "Keep what was found."),
        verb_operation("calibration end", "/calibration/end", "Look no more."),
        Operation(
            "GET", "/calibration/board.png", "A board for the printer, 300 dpi.", board,
            media="image/png", refusals=(503,),
        ),
    ),
    has_verbs("calibration show", "calibration begin", "calibration save", "calibration end"),
)  # fmt: skip
