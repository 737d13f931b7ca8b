"""A stretch of a drive, for `arm.py`: recorded on the host, lived through on the emulated board.

On the host `render` drives 25 s in the built-in flat and keeps the events, the last frames, and
what SGBM and the network make of one of them. On the board the brain lives through the events as
they were logged; the last frames go through the whole chain again, between markers that count
executed instructions.
"""

from __future__ import annotations

import ctypes
import dataclasses
import json
import pickle
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

SECONDS, WARM, COUNTED = 25, 8, 8
MARKER = 9999


def render(target: Path) -> Path:
    """The recording, made once. SystemExit when the simulator fails."""
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
    frames = list(read_frames(log))[-(WARM + COUNTED) :]
    last = frames[-1]
    stretch = {
        "events": list(read_events(log)),
        "frames": frames,
        "sgbm": _match("sgbm", last),
        "onnx": _match("onnx", last),
    }
    target.write_bytes(pickle.dumps(stretch))
    return target


def _config(matcher: str) -> Any:
    from robot.config import parse_config

    return parse_config(f'[perception]\nmatcher = "{matcher}"\n')


def _match(matcher: str, frame: Any) -> np.ndarray:
    from robot.body.sources import open_depth

    config = _config(matcher)
    depth = open_depth(config, config.camera.stereo_camera())
    return np.asarray(depth.match(frame.left, frame.right).disparity_px)


def live(stretch: dict[str, Any], mark: Any, matcher: str = "sgbm") -> tuple[int, int]:
    """Frames and ticks that were counted."""
    from robot.body.sources import open_perception
    from robot.brain import Brain
    from robot.messages import Seen, Tick

    config = _config(matcher)
    brain, perception = Brain(config), open_perception(config)
    frames = {frame.t_ns: frame for frame in stretch["frames"]}
    seen = frames_counted = ticks = 0
    counting = False
    for event in stretch["events"]:
        frame = frames.get(event.t_ns) if isinstance(event, Seen) else None
        if frame is not None:
            seen += 1
            counting = seen > WARM
            if counting:
                mark(MARKER, ctypes.c_long(2 * frames_counted))
            found = perception.see(frame, event.arrived_ns)
            brain.on(dataclasses.replace(found, arrived_ns=event.arrived_ns))
            if counting:
                mark(MARKER, ctypes.c_long(2 * frames_counted + 1))
                frames_counted += 1
            continue
        if counting and not isinstance(event, Seen):
            mark(MARKER, ctypes.c_long(100_000 + 2 * ticks))
        brain.on(event)
        if counting and not isinstance(event, Seen):
            mark(MARKER, ctypes.c_long(100_001 + 2 * ticks))
            ticks += 1
    beats = sum(isinstance(e, Tick) for e in stretch["events"][-ticks:]) if ticks else 1
    return frames_counted, max(1, beats)


def main() -> None:
    """On the board: print what was counted and compared as JSON."""
    stretch = pickle.loads(Path(sys.argv[1]).read_bytes())
    last = stretch["frames"][-1]
    sgbm, network = _match("sgbm", last), _match("onnx", last)
    same = np.isclose(sgbm, stretch["sgbm"], atol=1e-4, equal_nan=True)
    both = np.isfinite(network) & np.isfinite(stretch["onnx"])
    start_s = time.process_time()
    frames, ticks = live(stretch, ctypes.CDLL(None).syscall)
    print(json.dumps({
        "frames": frames,
        "ticks": ticks,
        "sgbm_differs": int((~same).sum()),
        "network_px": round(float(np.abs(network - stretch["onnx"])[both].mean()), 5),
        "emulated_s": round(time.process_time() - start_s, 1),
    }))  # fmt: skip


if __name__ == "__main__":
    main()
