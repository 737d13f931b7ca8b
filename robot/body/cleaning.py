"""`sweeper run` and `sweeper record`: put a brain into a body, let it live, keep what happened."""

from __future__ import annotations

import itertools
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import cv2

from robot.body.eyes import DrawnEyes, Eyes, RenderedEyes
from robot.body.kept.keeper import HomeKeeper
from robot.body.kept.store import HomeStore
from robot.body.knocked import WatchedPerception
from robot.body.live import LiveBody
from robot.body.notify import Notifier
from robot.body.records.observe import Observer, Snapshot
from robot.body.records.ring import LogFile, open_log, rescued
from robot.body.records.summary import Judge, summarise, write_run_folder
from robot.body.simulated import SimulatedBody
from robot.body.sources import (
    open_calibration,
    open_gauge,
    open_gyro,
    open_perception,
    open_stereo,
    read_calibration,
)
from robot.body.talk.onlookers import Onlookers
from robot.brain import Brain
from robot.config import Config, dump_config
from robot.errors import SweeperError
from robot.hardware.wheels import open_wheels
from robot.log.header import LogHeader
from robot.run import never, run

MAX_SIM_S = 1800.0  # a simulated clean that takes longer has lost its way,
MAX_SIM_S_PER_M2 = 120.0  # or than this in a larger home
WEEK_S = 7 * 24 * 3600.0  # of waiting for requests


@dataclass(frozen=True, slots=True)
class RunOptions:
    """What the command line asks for."""

    body: str = "sim"
    scene: str = "flat"
    seed: int = 1
    duration_s: float | None = None
    out: Path = Path("runs")
    frames: bool = False
    wait: bool = False
    real_time: bool = False
    drawn: bool = False
    socket: Path | None = None
    log_ring: Path | None = None  # folder in RAM for a log that never grows
    home: Path | None = None  # folder of the map that is known and kept


def run_cleaning(
    options: RunOptions,
    config: Config,
    progress: Callable[[Snapshot], None],
    ended: Callable[[], str] = never,
) -> dict[str, Any]:
    """Run until the mission or the time ends, or `ended` names who wants that.

    Writes the run folder and the link `latest` beside it, and returns the summary.
    """
    with ExitStack() as stack:
        judge = _open_world(options, config) if options.body == "sim" else None
        store = None if options.home is None else HomeStore(options.home)
        known = None if store is None else store.load(lambda text: print(text, file=sys.stderr))
        folder = _new_folder(options)
        header = LogHeader(
            config_toml=dump_config(config),
            camera=config.camera.stereo_camera(),
            scene=options.scene if judge else "",
            seed=options.seed,
            body=options.body,
            wall_time=datetime.now(UTC).isoformat(timespec="seconds"),
            calibration=read_calibration(config) if config.camera.calibration else "",
            calibration_name=config.camera.calibration,
            home=b"" if known is None else known[0],
        )
        log: LogFile = open_log(options.log_ring, folder, header, config.log)
        stack.enter_context(log)
        observer = Observer(log, log, progress, judge.covered_pct if judge else None)
        brain = Brain(config, None if known is None else known[1])
        if judge is not None:
            observer.on_truth = lambda pose: judge.look(pose, brain.notes.current)
        onlookers = Onlookers(options.socket, config, options.body, stack)
        loop_log = onlookers.stand_before(observer, brain, lambda name: _run_folder(options, name))
        if options.home is not None:
            loop_log = onlookers.keep_books(loop_log, options.home)
        keeper = None if store is None else HomeKeeper(loop_log, brain, store)
        body = (
            _simulated(options, config, judge, observer, onlookers, stack)
            if judge
            else _live(options, config, observer, onlookers, stack)
        )
        started_s = time.monotonic()
        with rescued(log, folder):
            run(body, brain, keeper or loop_log, ended)
        ended_by = ended() or None
        wall_s = time.monotonic() - started_s
        if keeper is not None:
            keeper.close()
    summary = summarise(observer, body, judge, options.scene, options.seed, wall_s)
    summary["ended_by"] = ended_by
    summary["log"] = str(options.log_ring or folder / "log.mcap")
    write_run_folder(folder, summary, observer, judge, config)
    return summary


def _open_world(options: RunOptions, config: Config) -> Judge:
    from robot.sim.base import SimBase
    from robot.sim.scene import load_scene

    world = load_scene(options.scene)
    base = SimBase(
        world,
        config.robot,
        config.sim,
        options.seed,
        metres_per_tick=config.link.metres_per_tick,
        full_speed_mps=config.link.full_speed_mps,
    )
    return Judge(world, base, config.robot)


def _simulated(
    options: RunOptions,
    config: Config,
    judge: Judge,
    observer: Observer,
    onlookers: Onlookers,
    stack: ExitStack,
) -> SimulatedBody:
    from firmware_bridge.host import HostFirmware, build_host_firmware

    build = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="sweeper-")))
    cv2.setNumThreads(1)  # two cores are busy with drawing, seeing and thinking side by side
    eyes = _eyes(options, config, judge, onlookers)
    stack.callback(eyes.close)
    firmware = HostFirmware(build_host_firmware(build))
    stack.callback(firmware.close)
    body = SimulatedBody(
        config,
        judge.world,
        judge.base,
        firmware,
        eyes,
        observer,
        duration_s=options.duration_s or _longest_s(options, judge),
        record_frames=options.frames,
        real_time=options.real_time,
        start=not options.wait,
        control=onlookers.asked,
    )
    stack.callback(body.close)
    return body


def _longest_s(options: RunOptions, judge: Judge) -> float:
    """When a run without a wish of its own ends at the latest."""
    if options.wait and options.socket:
        return WEEK_S
    return max(MAX_SIM_S, MAX_SIM_S_PER_M2 * judge.floor.area_m2)


def _eyes(options: RunOptions, config: Config, judge: Judge, onlookers: Onlookers) -> Eyes:
    if options.drawn:
        from robot.sim.drawn import DrawnSight

        return DrawnEyes(DrawnSight(judge.world, config, options.seed))
    from robot.sim.render_process import RenderProcess

    camera = config.camera.stereo_camera()
    renderer = RenderProcess(options.scene, camera, config.sim, options.seed)
    perception = open_perception(config)
    onlookers.look_through(perception)
    return RenderedEyes(renderer, perception)


def _live(
    options: RunOptions,
    config: Config,
    observer: Observer,
    onlookers: Onlookers,
    stack: ExitStack,
) -> LiveBody:
    wheels = open_wheels(config.robot, config.link)
    stack.callback(wheels.close)
    if options.wait and not options.frames and options.socket is None:
        raise SweeperError("--wait needs --socket PATH, so that `sweeper ask start` can reach it.")
    perception = open_perception(config)
    onlookers.look_through(perception)
    body = LiveBody(
        config,
        open_stereo(config),
        WatchedPerception(perception, open_calibration(config)),
        wheels,
        gyro=open_gyro(config),
        gauge=open_gauge(config),
        control=onlookers.asked,
        recorder=onlookers.recorder(observer if options.frames else None),
        notifier=Notifier(),
        duration_s=options.duration_s or float("inf"),
        start=not options.wait,
    )
    stack.callback(body.close)
    return body


def _new_folder(options: RunOptions) -> Path:
    """Make `out/<time>-<what>` and let `out/latest` point to it; others may run beside."""
    scene = Path(options.scene).stem.replace(":", "-")
    what = f"{scene}-{options.seed}" if options.body == "sim" else "live"
    stamp = datetime.now(UTC).strftime("%Y%m%d-%H%M%S")
    try:
        options.out.mkdir(parents=True, exist_ok=True)
        folder = _run_folder(options, f"{stamp}-{what}")
        link = options.out / f".latest-{folder.name}"
        link.symlink_to(folder.name)
        link.replace(options.out / "latest")
    except OSError as error:
        raise SweeperError(
            f"--out {options.out}: cannot be written ({error.strerror}); give a writable folder."
        ) from None
    return folder


def _run_folder(options: RunOptions, name: str) -> Path:
    return _make_unique(options.out / name)


def _make_unique(wanted: Path) -> Path:
    for number in itertools.count():
        folder = wanted.with_name(f"{wanted.name}-{number}") if number else wanted
        with suppress(FileExistsError):
            folder.mkdir()
            return folder
    raise AssertionError("unreachable")
