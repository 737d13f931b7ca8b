"""What `sweeper log info` and `export` do: look into a log, hand it on to other tools."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from robot.errors import LogError
from robot.log.export import write_tum
from robot.log.reader import Entry, Kind, LogReader
from robot.mapping.map_server import grid_to_map_server
from robot.messages import MapReport, PoseEstimate, StereoFrame

NS = 1_000_000_000
MP4_HZ = 10.0


def log_info(path: Path) -> dict[str, Any]:
    """What the log says about itself, how it ends, and how many messages of each type it has.

    Raises LogError.
    """
    counts: Counter[str] = Counter()
    span: list[int] = []
    with LogReader(path) as log:
        for entry in log.entries(("event", "command", "frame", "truth")):
            counts[f"{entry.kind}/{entry.type.__name__}"] += 1
            if entry.kind == "event" and entry.type.__name__ == "Tick":
                span = [*span[:1], log.decoded(entry).t_ns]
        header = log.header
        ending, problem = log.ending, log.problem
    return {
        "log": str(path),
        "bytes": path.stat().st_size,
        "ending": ending,
        "problem": problem,
        "duration_s": round((span[-1] - span[0]) / NS, 2) if span else None,
        "body": header.body,
        "scene": header.scene or None,
        "seed": header.seed,
        "wall_time": header.wall_time,
        "software": header.software,
        "messages": dict(sorted(counts.items())),
    }


def export_log(path: Path, out: Path, to: str) -> list[str]:
    """Write the log's part that `to` can hold; returns the names. Raises LogError."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        with LogReader(path) as log:
            files = {
                "tum": _tum,
                "map_server": _map_server,
                "euroc": _euroc,
                "png": _png,
                "mp4": _mp4,
            }[to](log, out)
    except OSError as error:
        raise LogError(
            f"{out}: cannot be written ({error.strerror}); give a writable folder."
        ) from None
    if not files:
        raise LogError(f"{path}: holds nothing for {to}; frames are kept by `sweeper record` only.")
    return files


def _tum(log: LogReader, out: Path) -> list[str]:
    estimates: list[tuple[float, ...]] = []
    truth: list[tuple[float, ...]] = []
    for entry in log.entries(("command", "truth")):
        if entry.kind == "truth" or entry.type is PoseEstimate:
            message = log.decoded(entry)
            pose = message.world_from_base
            row = (message.t_ns / NS, pose.x_m, pose.y_m, pose.yaw_rad)
            (truth if entry.kind == "truth" else estimates).append(row)
    tracks = {"trajectory.tum": estimates, "truth.tum": truth}
    for name, rows in tracks.items():
        if rows:
            (out / name).write_text(write_tum(np.array(rows)), encoding="utf-8")
    return [name for name, rows in tracks.items() if rows]


def _map_server(log: LogReader, out: Path) -> list[str]:
    last: Entry | None = None
    kinds: tuple[Kind, ...] = ("command",)
    for entry in log.entries(kinds):
        if entry.type is MapReport:
            last = entry
    if last is None:
        return []
    pgm, text = grid_to_map_server(log.decoded(last).grid, "map.pgm")
    (out / "map.pgm").write_bytes(pgm)
    (out / "map.yaml").write_text(text, encoding="utf-8")
    return ["map.pgm", "map.yaml"]


def _euroc(log: LogReader, out: Path) -> list[str]:
    """The EuRoC ASL layout: mav0/cam0 and cam1, PNG files named by their time."""
    lines = ["#timestamp [ns],filename\n"]
    eyes = [out / "mav0" / f"cam{number}" for number in range(2)]
    for frame in _frames(log):
        name = f"{frame.t_ns:019d}.png"
        for eye, image in zip(eyes, (frame.left, frame.right), strict=True):
            (eye / "data").mkdir(parents=True, exist_ok=True)
            cv2.imwrite(str(eye / "data" / name), image)
        lines.append(f"{frame.t_ns},{name}\n")
    if len(lines) == 1:
        return []
    for eye in eyes:
        (eye / "data.csv").write_text("".join(lines), encoding="utf-8")
    return [f"mav0/cam{number}/data.csv" for number in range(2)]


def _png(log: LogReader, out: Path) -> list[str]:
    names = []
    for frame in _frames(log):
        names.append(f"{frame.seq:06d}.png")
        cv2.imwrite(str(out / names[-1]), np.hstack([frame.left, frame.right]))
    return names


def _mp4(log: LogReader, out: Path) -> list[str]:
    video = None
    for frame in _frames(log):
        picture = np.hstack([frame.left, frame.right])
        if video is None:
            code = cv2.VideoWriter.fourcc(*"mp4v")
            size = (picture.shape[1], picture.shape[0])
            video = cv2.VideoWriter(str(out / "frames.mp4"), code, MP4_HZ, size, False)
        video.write(picture)
    if video is None:
        return []
    video.release()
    return ["frames.mp4"]


def _frames(log: LogReader) -> Any:
    """Every recorded pair."""
    for frame in log.messages("frame"):
        assert isinstance(frame, StereoFrame)
        yield frame
