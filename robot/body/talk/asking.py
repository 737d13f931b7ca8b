"""`sweeper ask`: its manual is the table of verbs."""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

from robot.body.talk.control import ask
from robot.errors import RequestError
from robot.mission.verbs import VERBS, understand

AGAIN_S = 0.1  # how often an order by hand is repeated while it shall hold
MAX_HOLD_S = 60.0


def add_ask_options(verb: argparse.ArgumentParser) -> None:
    """The words, the socket and the manual of `sweeper ask`."""
    width = max(len(known.usage) for known in VERBS)
    lines = [f"  {known.usage:{width}}  {known.summary}" for known in VERBS]
    verb.formatter_class = argparse.RawDescriptionHelpFormatter
    verb.epilog = (
        "Requests:\n" + "\n".join(lines) + "\n\n"
        "Coordinates are metres of the map; on its dock the robot is at 0 0 and looks along x.\n"
        f"{verb.epilog or ''}"
    )
    verb.add_argument("verb", metavar="REQUEST", help="one of the requests below")
    verb.add_argument("args", nargs="*", metavar="ARGUMENT")
    verb.add_argument("--socket", type=Path, default=Path("/run/sweeper/control.sock"))
    verb.add_argument(
        "--hold-s", type=float, default=0.0, help="repeat `manual` for so long: it expires at once"
    )


def ask_for(arguments: argparse.Namespace) -> dict[str, Any]:
    """Send the request; returns the last answer. Raises RequestError and HardwareError."""
    known, rest = understand([arguments.verb, *arguments.args])  # no robot is needed to refuse it
    if arguments.hold_s and (known.name != "manual" or not 0 < arguments.hold_s <= MAX_HOLD_S):
        raise RequestError(f"--hold-s is for manual, up to {MAX_HOLD_S:.0f} s; leave it out.")
    answer = ask(arguments.socket, known.name, list(rest))
    until_s = time.monotonic() + arguments.hold_s
    while answer.get("accepted") and time.monotonic() < until_s:
        time.sleep(AGAIN_S)
        answer = ask(arguments.socket, known.name, list(rest))
    return answer


def sentences(answer: dict[str, Any]) -> str:
    """For people: the reason, and what is listed line by line."""
    lines = [str(answer.get("reason", ""))]
    data = answer.get("data")
    listed = data.get("lines") if isinstance(data, dict) else None
    return "\n".join(lines + [str(line) for line in listed or []])
