"""The grammar of `sweeper calibrate`; what does the work is loaded only when it is asked for."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

Verb = Callable[[argparse.Namespace], dict[str, Any]]
Function = Callable[[argparse.Namespace], int]
AddVerb = Callable[[Any, str, str, Function], argparse.ArgumentParser]
DEFAULT_BOARD = "charuco:9x6:24mm"
FORMATS = ("opencv", "kalibr", "ros")


def _later(module: str, name: str) -> Verb:
    """The verb of that name in `robot.body.calibration.<module>`, imported when it is called."""

    def call(arguments: argparse.Namespace) -> dict[str, Any]:
        result: dict[str, Any] = getattr(import_module(f"robot.body.calibration.{module}"), name)(
            arguments
        )
        return result

    return call


def add_verbs(verbs: Any, verb: AddVerb, write_json: Callable[[str | None, Any], None]) -> None:
    """The grammar of `sweeper calibrate`."""

    def add(name: str, summary: str, function: Verb) -> argparse.ArgumentParser:
        def run(arguments: argparse.Namespace) -> int:
            write_json(arguments.json, function(arguments))
            return 0

        made = verb(verbs, name, summary, run)
        made.add_argument("--config", type=Path, help="TOML file with differences to the defaults")
        return made

    board = add("board", "draw a calibration board for the printer", _later("cameras", "board"))
    _add_board(board)
    board.add_argument("--out", type=Path, default=Path("board.png"), help="a picture at 300 dpi")

    stereo = add(
        "stereo",
        "both cameras, from live pictures or a folder of a board",
        _later("cameras", "stereo"),
    )
    _add_board(stereo)
    stereo.add_argument("--frames", type=Path, metavar="DIR", help="recorded pairs, not live ones")
    stereo.add_argument("--size", default="", metavar="WxH", help="of each eye, live")
    stereo.add_argument("--out", type=Path, help="default: camera.calibration of --config")
    stereo.add_argument("--layout", choices=FORMATS, default="opencv", help="of the file")
    stereo.add_argument("--views", type=int, default=20, help="pictures to collect live")
    stereo.add_argument("--seconds", type=float, default=300.0, help="at most, live")
    stereo.add_argument("--keep", type=Path, metavar="DIR", help="keep the pictures, live")
    stereo.add_argument("--max-rms-px", type=float, help="refuse above; default 0.5")
    stereo.add_argument("--max-epipolar-px", type=float, help="refuse above; default 0.3")

    convert = add(
        "convert", "rewrite a calibration in another layout", _later("cameras", "convert")
    )
    convert.add_argument("files", nargs="+", type=Path, metavar="FILE", help="one, or left right")
    convert.add_argument("--out", type=Path, required=True)
    convert.add_argument("--layout", choices=FORMATS, default="opencv")

    for name, summary in (
        ("imu", "bias, noise and mounting of the gyro, standing still"),
        ("wheels", "wheel scale and track width; the robot drives a metre and turns"),
        ("camera-pose", "height, pitch and roll of the cameras over bare floor"),
        ("sync", "are both eyes exposed at once? watches a blinking light"),
    ):
        made = add(name, summary, _later("sensors", name.replace("-", "_")))
        if name != "sync":
            made.add_argument("--apply", action="store_true", help="enter the values in --config")
        if name in ("sync", "camera-pose"):
            made.add_argument("--frames", type=Path, metavar="DIR", help="recorded pairs")
        if name == "sync":
            made.add_argument("--blink-hz", type=float, required=True, help="of the light")
            made.add_argument("--pairs", type=int, default=300, help="to look at, live")
        if name == "wheels":
            made.add_argument("--measured-m", type=float, help="what the tape says; else asked")
            made.add_argument("--yes", action="store_true", help="the floor around it is free")


def _add_board(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--board", default=DEFAULT_BOARD, help=f"inner corners and square; default {DEFAULT_BOARD}"
    )
