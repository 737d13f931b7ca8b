"""`sweeper calibrate board | stereo | convert`; the grammar is in `calibrate_verbs`."""

from __future__ import annotations

import argparse
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import cv2

from robot.body.kept.store import write_whole
from robot.calibrate.apply import set_keys
from robot.calibrate.board import parse_board
from robot.calibrate.files import Provenance, write_calibration
from robot.calibrate.stereo import MAX_EPIPOLAR_PX, MAX_RMS_PX
from robot.config import Config, load_config
from robot.errors import CalibrationError, SweeperError
from robot.perception.calibration import StereoCalibration
from robot.perception.calibration_files import parse_calibration

Result = dict[str, Any]


def board(arguments: argparse.Namespace) -> Result:
    picture = parse_board(arguments.board).draw(300.0 / 0.0254)
    if not cv2.imwrite(str(arguments.out), picture):
        raise CalibrationError(f"--out {arguments.out}: cannot be written; give a writable .png.")
    size_mm = [round(n * 25.4 / 300.0, 1) for n in picture.shape[::-1]]
    print(
        f"{arguments.out}: print at 300 dpi without scaling ({size_mm[0]} x {size_mm[1]} mm), glue "
        "it on a flat plate, measure a square, and say that size in --board."
    )
    return {"file": str(arguments.out), "size_mm": size_mm}


def stereo(arguments: argparse.Namespace) -> Result:
    from robot.body.calibration.views import collect_folder, collect_live
    from robot.calibrate.stereo import calibrate_stereo

    config = load_config(arguments.config)
    pattern = parse_board(arguments.board)
    target = arguments.out or Path(config.camera.calibration or "stereo.yaml")
    if arguments.frames is not None:
        collected = collect_folder(arguments.frames, pattern)
    else:
        collected = collect_live(
            config, pattern, _size(arguments.size, config), arguments.views, arguments.seconds,
            arguments.keep,
        )  # fmt: skip
    if arguments.json != "-":
        print(collected.coverage.picture())
    found = calibrate_stereo(collected.views, pattern, collected.size_px)
    result: Result = {
        "rms_px": found.rms_px,
        "epipolar_px": found.epipolar_px,
        "epipolar_unseen_px": found.unseen_epipolar_px,
        "views": found.views,
        "left_out": list(found.left_out),
        "coverage_pct": 100.0 * collected.coverage.share,
        "baseline_m": found.calibration.baseline_m,
        "focal_px": float(found.calibration.left.matrix[0, 0]),
        "files": [],
    }
    if arguments.json != "-":
        for key, value in result.items():
            print(f"{key:20s} {value}")
        if advice := collected.coverage.advice():
            print(f"The image is covered thinly: {advice}.")
    found.refuse_above(
        arguments.max_rms_px or MAX_RMS_PX, arguments.max_epipolar_px or MAX_EPIPOLAR_PX
    )
    date = datetime.now(UTC).isoformat(timespec="seconds")
    provenance = Provenance(date, found.rms_px, found.unseen_epipolar_px)
    result["files"] = save(found.calibration, target, arguments.layout, provenance)
    return result


def convert(arguments: argparse.Namespace) -> Result:
    calibration = read_files(arguments.files)
    return {"files": save(calibration, arguments.out, arguments.layout, None)}


def read_files(files: list[Path]) -> StereoCalibration:
    """The calibration in one file, or in one for each eye. Raises CalibrationError."""
    if len(files) > 2:
        raise CalibrationError(f"{len(files)} files given; name one, or the left and right one.")
    texts = []
    for file in files:
        try:
            texts.append(file.read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError) as error:
            raise CalibrationError(f"{file}: cannot be read ({error}); name a text file.") from None
    if len(files) == 1:
        return parse_calibration(texts[0], str(files[0]))
    return parse_calibration(texts[0], str(files[0]), texts[1], str(files[1]))


def save(
    calibration: StereoCalibration, target: Path, layout: str, provenance: Provenance | None
) -> list[str]:
    """Write `target`, or for ROS its `.left` and `.right` sisters; returns the names."""
    texts = write_calibration(calibration, layout, provenance)
    targets = [target]
    if len(texts) == 2:
        targets = [target.with_suffix(f".{side}{target.suffix}") for side in ("left", "right")]
    try:
        for file, text in zip(targets, texts, strict=True):
            write_whole(file, text.encode())
    except OSError as error:
        raise CalibrationError(
            f"{error.filename or target}: cannot be written ({error.strerror}); give a writable "
            "path, or run as root."
        ) from None
    return [str(file) for file in targets]


def apply(arguments: argparse.Namespace, values: dict[str, float | str]) -> None:
    """Show the configuration's new lines; enter them when --apply says so."""
    if arguments.json != "-":
        print("\n".join(f"{key} = {value!r}" for key, value in values.items()))
    if not arguments.apply:
        return
    if arguments.config is None:
        raise SweeperError("--apply needs --config FILE, which it changes.")
    load_config(arguments.config)
    text = set_keys(arguments.config.read_text(encoding="utf-8"), values, str(arguments.config))
    try:
        write_whole(arguments.config, text.encode())
    except OSError as error:
        raise SweeperError(
            f"{arguments.config}: cannot be written ({error.strerror}); run as root."
        ) from None


def _size(text: str, config: Config) -> tuple[int, int]:
    if not text:
        return config.camera.width_px, config.camera.height_px
    width, _, height = text.partition("x")
    if not (width.isdigit() and height.isdigit()):
        raise CalibrationError(f"--size '{text}' is no size; write for example 640x480.")
    return int(width), int(height)
