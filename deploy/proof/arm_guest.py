"""What the emulated board lives through, for `arm.py`; made on the host, measured on the board.

*Sights*: frames along a fixed way through the built-in flat, and what SGBM and the network make of
the last one on the host. On the board each matcher's whole perception sees them: instructions that
depend on nothing but perception. *Drive*: events and frames of 25 s of cleaning. On the board the
brain lives through the events as they were logged, and the last frames go through perception again.
"""

from __future__ import annotations

import ctypes
import dataclasses
import json
import pickle
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np

SECONDS, WARM, COUNTED = 25, 8, 8
SIGHTS, SIGHTS_WARM = 12, 6
STEP_M, TURN_RAD = 0.02, 0.03  # between two sights
MATCHERS = ("sgbm", "onnx")
MARKER = 9999


class Meter:
    """Brackets a stretch of work for the plugin that counts instructions."""

    def __init__(self) -> None:
        self.names: list[str] = []
        self._call = ctypes.CDLL(None).syscall

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        tag = 2 * len(self.names)
        self.names.append(name)
        self._call(MARKER, ctypes.c_long(tag))
        yield
        self._call(MARKER, ctypes.c_long(tag + 1))


# ---------------------------------------------------------------- on the host


def record_sights(target: Path) -> Path:
    """Frames of a fixed way, made once."""
    if target.exists():
        return target
    from robot.config import Config
    from robot.geometry.se2 import SE2
    from robot.sim.rig import StereoRig
    from robot.sim.scene import load_scene

    world = load_scene("flat")
    rig = StereoRig(world, Config().camera.stereo_camera(), Config().sim, 1)
    pose = SE2(world.start.x_m - 0.5, world.start.y_m, world.start.yaw_rad + 2.0)
    frames = []
    for k in range(SIGHTS):
        frame, _ = rig.render(100_000_000 * k, k, pose)
        frames.append(dataclasses.replace(frame, yaw_change_rad=TURN_RAD))
        pose = pose @ SE2(STEP_M, 0.0, TURN_RAD)
    matched = {name: _matched(name, frames[-1]) for name in MATCHERS}
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_bytes(pickle.dumps({"frames": frames, "matched": matched}))
    return target


def record_drive(target: Path) -> Path:
    """A recording of the simulated robot, made once. SystemExit when the simulator fails."""
    if target.exists():
        return target
    from robot.log.reader import read_events, read_frames

    runs = target.with_suffix(".runs")
    done = subprocess.run(
        [sys.executable, "-m", "robot", "record", "--clean", "--duration-s", str(SECONDS),
         "--no-progress", "--out", str(runs)], capture_output=True, text=True, check=False,
    )  # fmt: skip
    log = runs / "latest/log.mcap"
    if not log.exists():
        raise SystemExit(f"the simulated drive failed: {done.stderr.strip()[-300:]}")
    drive = {
        "events": list(read_events(log)),
        "frames": list(read_frames(log))[-(WARM + COUNTED) :],
    }
    target.write_bytes(pickle.dumps(drive))
    return target


def _config(matcher: str) -> Any:
    from robot.config import parse_config

    return parse_config(f'[perception]\nmatcher = "{matcher}"\n')


def _matched(matcher: str, frame: Any) -> np.ndarray:
    from robot.body.sources import open_depth

    config = _config(matcher)
    depth = open_depth(config, config.camera.stereo_camera())
    return np.asarray(depth.match(frame.left, frame.right).disparity_px)


# ---------------------------------------------------------------- on the board


def look(sights: dict[str, Any], meter: Meter) -> dict[str, float]:
    """Perception with each matcher; how far the matchers are from what the host saw."""
    from robot.body.sources import open_perception

    for name in MATCHERS:
        perception = open_perception(_config(name))
        for k, frame in enumerate(sights["frames"]):
            with meter(f"sight_{name}" if k >= SIGHTS_WARM else "warm"):
                perception.see(frame, frame.t_ns)
    last, theirs = sights["frames"][-1], sights["matched"]
    sgbm, network = (_matched(name, last) for name in MATCHERS)
    same = np.isclose(sgbm, theirs["sgbm"], atol=1e-4, equal_nan=True)
    both = np.isfinite(network) & np.isfinite(theirs["onnx"])
    away = np.abs(network - theirs["onnx"])[both]
    return {"sgbm_differs": int((~same).sum()), "network_px": round(float(away.mean()), 5)}


def live(drive: dict[str, Any], meter: Meter, matcher: str = "sgbm") -> int:
    """Brain and perception through the drive; the number of ticks that were counted."""
    from robot.body.sources import open_perception
    from robot.brain import Brain
    from robot.messages import Seen, Tick

    config = _config(matcher)
    brain, perception = Brain(config), open_perception(config)
    frames = {frame.t_ns: frame for frame in drive["frames"]}
    seen = ticks = 0
    for event in drive["events"]:
        frame = frames.get(event.t_ns) if isinstance(event, Seen) else None
        if frame is not None:
            seen += 1
            with meter("frame" if seen > WARM else "warm"):
                found = perception.see(frame, event.arrived_ns)
                brain.on(dataclasses.replace(found, arrived_ns=event.arrived_ns))
        elif seen > WARM and not isinstance(event, Seen):
            ticks += isinstance(event, Tick)
            with meter("tick"):
                brain.on(event)
        else:
            brain.on(event)
    return ticks


def main() -> None:
    """`sights FILE` or `drive FILE`: print what was compared, and what the marks stand for."""
    cv2.setNumThreads(1)  # the plugin counts for all threads together, without a lock
    what, recorded = sys.argv[1], pickle.loads(Path(sys.argv[2]).read_bytes())
    meter, start_s = Meter(), time.process_time()
    compared = look(recorded, meter) if what == "sights" else {}
    ticks = live(recorded, meter) if what == "drive" else 0
    print(json.dumps({
        "names": meter.names,
        "ticks": ticks,
        "compared": compared,
        "emulated_s": round(time.process_time() - start_s, 1),
    }))  # fmt: skip


if __name__ == "__main__":
    main()
