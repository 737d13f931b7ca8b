"""Which releases are installed, and what to type for an update or the way back.

This process only reads. Whoever puts a release in place decides what runs as root, so that takes
root's own hands and never a request over the network.
"""

import asyncio
import json
import os
from pathlib import Path
from typing import Any

from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from robot.serve.capability import Capability, Operation, Robot, Schema

UPDATE = "git pull && sudo deploy/install.sh --update"
ROLLBACK = "sudo python3 /opt/sweeper/boot/slots.py rollback"
HISTORY_LINES = 10
MAX_BYTES = 1 << 16
TEXT: Schema = {"type": "string"}
ANSWER: Schema = {
    "type": "object",
    "required": ["current", "previous", "trial_starts", "history", "update", "rollback"],
    "properties": {
        "current": TEXT,
        "previous": TEXT,
        "trial_starts": {"type": ["integer", "null"]},
        "history": {"type": "array", "items": TEXT},
        "update": TEXT,
        "rollback": TEXT,
    },
}


async def read(robot: Robot, request: Request) -> Response:
    """The two slots, and how many starts a release on trial has had."""
    return JSONResponse(await asyncio.to_thread(slots, robot.installed))


def slots(home: Path) -> dict[str, Any]:
    """What `deploy` has noted below its folder."""
    current, previous = _release(home / "current"), _release(home / "previous")
    return {
        "current": current,
        "previous": previous,
        "trial_starts": _trial_starts(home / "trial", current),
        "history": _text(home / "history.log").splitlines()[-HISTORY_LINES:],
        "update": UPDATE,
        "rollback": ROLLBACK if previous not in ("", current) else "",
    }


def _release(link: Path) -> str:
    try:
        return Path(os.readlink(link)).name
    except OSError:
        return ""


def _trial_starts(note: Path, current: str) -> int | None:
    try:
        noted = json.loads(_text(note))
        return int(noted["starts"]) if noted["release"] == current else None
    except (ValueError, KeyError, TypeError, RecursionError):
        return None


def _text(path: Path) -> str:
    try:
        with open(path, encoding="utf-8", errors="replace") as file:
            return file.read(MAX_BYTES)
    except OSError:
        return ""


CAPABILITY = Capability(
    "update",
    "Update",
    "Installed releases: what runs, the way back, whether one is on trial, and what to type.",
    (Operation("GET", "/update", "The releases, and their history.", read, ANSWER),),
    has=lambda robot: bool(_release(robot.installed / "current")),
)
