"""`make camera`: real libcamera, no camera.

Debian trixie's libcamera has a virtual pipeline that delivers pictures from a folder. It runs in an
unpacked trixie on that Debian's own Python, exactly as on a robot, and feeds the runtime's adapter:
side-by-side pictures of the built-in flat must arrive in the right eyes, in time and in order, and
perception must see the flat in them. Needs root (chroot), gcc and `deploy/proof/userland.py`'s.
Exit code 3 says that the runtime is wrong; any other but 0, that this machine cannot show it.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import time
from pathlib import Path
from typing import NoReturn

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
from userland import run, unpack

from robot.config import Config
from robot.geometry.se2 import SE2
from robot.hardware import libcamera_stereo
from robot.hardware.libcamera_stereo import LibcameraStereo
from robot.perception.chain import Perception
from robot.perception.depth import make_depth
from robot.sim.rig import StereoRig
from robot.sim.scene import load_scene

HERE = Path(__file__).resolve().parent
PACKAGES = ("python3", "python3-libcamera", "libcamera-ipa")
WIDTH, HEIGHT, PICTURES = 320, 240, 4


def furnish(root: Path) -> None:
    """Pictures, cameras and the memory shim inside the unpacked trixie."""
    frames = root / "opt/frames"
    shutil.rmtree(frames, ignore_errors=True)
    frames.mkdir(parents=True)
    scene = load_scene("flat")
    rig = StereoRig(scene, Config().camera.stereo_camera(), Config().sim, 1)
    for n in range(PICTURES):
        pose = SE2(scene.start.x_m - 0.5, scene.start.y_m, scene.start.yaw_rad + 2.0 + 0.1 * n)
        frame, _ = rig.render(n, n, pose)
        cv2.imwrite(
            str(frames / f"{n}.jpg"), np.hstack([frame.left, frame.right]),
            [cv2.IMWRITE_JPEG_QUALITY, 98],
        )  # fmt: skip
    pipeline = root / "usr/share/libcamera/pipeline/virtual"
    pipeline.mkdir(parents=True, exist_ok=True)
    sizes = {"Both": 2 * WIDTH, "Left": WIDTH, "Right": WIDTH}
    cameras = {
        name: {
            "supported_formats": [{"width": width, "height": HEIGHT, "frame_rates": [10, 30]}],
            **({"frames": {"path": "/opt/frames"}} if name == "Both" else {"test_pattern": "bars"}),
            "location": "CameraLocationFront",
            "model": "Sweeper trial",
        }
        for name, width in sizes.items()
    }
    (pipeline / "virtual.yaml").write_text(json.dumps(cameras))  # JSON is YAML
    run("gcc", "-O2", "-Wall", "-shared", "-fPIC", "-o", root / "opt/heap.so", HERE / "heap.c")
    shutil.copy(libcamera_stereo.CHILD, root / "opt/child.py")


def opened(root: Path, cameras: list[str]) -> LibcameraStereo:
    """The runtime's own adapter; only the command that starts Python is another."""
    enter = "import os,sys; os.chroot(sys.argv[1]); os.chdir('/'); os.environ['LD_PRELOAD']="
    enter += "'/opt/heap.so'; os.execv('/usr/bin/python3', ['python3', *sys.argv[2:]])"
    return LibcameraStereo(
        cameras, eye_width_px=WIDTH, eye_height_px=HEIGHT, rate_hz=10.0,
        python=(sys.executable, "-c", enter, str(root)), child=Path("/opt/child.py"),
        environment={"LIBCAMERA_PIPELINES_MATCH_LIST": "virtual"},
    )  # fmt: skip


def watch(camera: LibcameraStereo, count: int) -> dict[str, object]:
    """Read `count` frames; what they say of time and order."""
    ages_ms, seqs, times = [], [], []
    for _ in range(count):
        frame = camera.read()
        if frame is None:
            raise SystemExit("libcamera stopped delivering")
        ages_ms.append((time.monotonic_ns() - frame.t_ns) / 1e6)
        seqs.append(frame.seq)
        times.append(frame.t_ns)
    rising = bool(np.all(np.diff(seqs) > 0) and np.all(np.diff(times) > 0))
    if not rising or min(ages_ms) < 0.0:
        wrong(f"frames out of order or time: ages {ages_ms}")
    return {"frames": count, "age_ms_p50": round(float(np.median(ages_ms)), 2)}


def seen(root: Path) -> dict[str, object]:
    """The flat through libcamera and perception, against the pictures that were rendered."""
    config = Config()
    camera_model = config.camera.stereo_camera()
    depth = make_depth(config.perception, camera_model, None)
    perception = Perception(config.perception, config.robot, camera_model, depth)
    pictures = [cv2.imread(str(p), cv2.IMREAD_GRAYSCALE)
                for p in sorted((root / "opt/frames").iterdir())]  # fmt: skip
    camera = opened(root, ["Both"])
    worst, ranges = 0.0, 0
    for _ in range(12):
        frame = camera.read()
        if frame is None:
            raise SystemExit("libcamera stopped delivering")
        both = np.hstack([frame.left, frame.right]).astype(float)
        worst = max(worst, min(float(np.abs(both - p).mean()) for p in pictures))
        scan = perception.see(frame, frame.t_ns).scan
        ranges = max(ranges, int(np.isfinite(scan.range_m).sum()))
    camera.close()
    if worst > 6.0:
        wrong(f"the pictures arrived changed: {worst:.1f} grey levels off")
    if not ranges:
        wrong("perception saw nothing in the pictures of the flat")
    return {"grey_levels_off": round(worst, 2), "ranges_seen": ranges}


def wrong(what: str) -> NoReturn:
    print(what, file=sys.stderr)
    raise SystemExit(3)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--work", type=Path, default=Path("build/proof"))
    work = parser.parse_args().work.resolve()
    root = unpack(work / "trixie-amd64", "trixie", "amd64", PACKAGES)
    furnish(root)
    composite = opened(root, ["Both"])
    result = {"composite": watch(composite, 200)}
    composite.close()
    dual = opened(root, ["Left", "Right"])
    result["dual"] = watch(dual, 100) | {"difference_us": dual.difference_ns // 1000}
    dual.close()
    result["perception"] = seen(root)
    print(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
