"""Checks of what is connected: cameras, calibration, network, motor controller, I2C sensors."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from datetime import UTC, datetime

import numpy as np

from firmware_bridge.host import build_number
from firmware_bridge.messages import Board
from robot.body.checks.findings import Finding, finding, ok, warn
from robot.body.halt import link_states, no_answer
from robot.body.sources import (
    open_battery_gauge,
    open_calibration,
    open_depth,
    open_imu,
    open_stereo,
    read_calibration,
)
from robot.calibrate.stereo import MAX_EPIPOLAR_PX
from robot.calibrate.sync import MAX_OFFSET_MS
from robot.config import Config
from robot.errors import HardwareError
from robot.hardware.i2c import open_bus
from robot.hardware.stereo import WatchedStereo
from robot.hardware.wheels import open_wheels
from robot.messages import StereoFrame
from robot.perception.epipolar import EpipolarWatch

FRAMES, LONGEST_S = 12, 8.0
DARK, BRIGHT, FLAT = 20.0, 235.0, 3.0  # grey levels: mean, mean, deviation
OLD_DAYS = 365
_DATE = re.compile(r'^calibration_date: "?([^"\n]+)"?$', re.M)
_EPIPOLAR = re.compile(r"^epipolar_px: ([0-9.]+)$", re.M)


def check_calibration(config: Config) -> Iterator[Finding]:
    """There, of the right size, good, and not older than a year."""
    rectifier = open_calibration(config)
    name = config.camera.calibration
    if rectifier is None:
        if config.camera.source == "folder":
            yield ok("calibration", "recorded frames are taken as already rectified")
        else:
            yield warn(
                "calibration",
                "camera.calibration is not set: the cameras are taken as perfect and level",
                "run `sweeper calibrate stereo` and set camera.calibration",
            )
        return
    text = read_calibration(config)
    width_px, height_px = rectifier.raw_size_px
    found = f"{name}: eyes of {width_px}x{height_px} px"
    date = _DATE.search(text)
    age_days = _age_days(date.group(1)) if date else None
    if age_days is not None and age_days > OLD_DAYS:
        yield warn(
            "calibration",
            f"{found}, {age_days} days old",
            "run `sweeper calibrate stereo` again: mounts settle and lenses move",
        )
        return
    epipolar = _EPIPOLAR.search(text)
    if epipolar and float(epipolar.group(1)) > MAX_EPIPOLAR_PX:
        yield warn(
            "calibration",
            f"{found}, rows off by {epipolar.group(1)} px",
            f"calibrate again, to less than {MAX_EPIPOLAR_PX} px",
        )
        return
    yield ok("calibration", found + (f", {age_days} days old" if age_days is not None else ""))


def _age_days(text: str) -> int | None:
    try:
        made = datetime.fromisoformat(text)
    except ValueError:
        return None
    return (datetime.now(UTC) - made.astimezone(UTC)).days


def check_model(config: Config) -> Iterator[Finding]:
    """The network loads, and is the one of the manifest."""
    open_depth(config, config.camera.stereo_camera())
    yield ok("model", f"matcher {config.perception.matcher} is ready")


def check_cameras(config: Config) -> Iterator[Finding]:
    """Pictures come, are neither dark nor flat, belong together, and their rows match."""
    camera = open_stereo(config)
    try:
        frames, differences_ns = _look(camera)
    finally:
        camera.close()
    where = f"camera.source = '{config.camera.source}', camera.device = '{config.camera.device}'"
    if not frames:
        raise HardwareError(
            f"{where}: {camera.problem or 'no frame came'}; replug the camera, check its cable."
        )
    yield _judge_pictures(frames, where)
    yield _judge_sync(config, differences_ns)
    yield from _judge_rows(config, frames)


def _look(camera: WatchedStereo) -> tuple[list[StereoFrame], list[int]]:
    frames: list[StereoFrame] = []
    differences: list[int] = []
    end_s = time.monotonic() + LONGEST_S
    while len(frames) < FRAMES and time.monotonic() < end_s:
        frame = camera.read()
        if frame is None:
            time.sleep(0.05)
        else:
            frames.append(frame)
            differences.append(camera.difference_ns)
    return frames, differences


def _judge_pictures(frames: list[StereoFrame], where: str) -> Finding:
    last = frames[-1]
    for side, eye in (("left", last.left), ("right", last.right)):
        mean, spread = float(eye.mean()), float(eye.std())
        if spread < FLAT or not DARK < mean < BRIGHT:
            return warn(
                "camera",
                f"the {side} eye sees next to nothing (mean {mean:.0f}, deviation {spread:.0f})",
                "take the cap off, clean the lens, light the room, or see camera.exposure_us",
            )
    if np.array_equal(last.left, last.right):
        return warn(
            "camera",
            "both eyes deliver the same picture",
            "choose the camera's side-by-side mode; it shows one eye twice",
        )
    seconds = (frames[-1].t_ns - frames[0].t_ns) / 1e9
    rate = f", {(len(frames) - 1) / seconds:.1f} frames/s" if seconds > 0.0 else ""
    return ok("camera", f"{where}: {last.left.shape[1]}x{last.left.shape[0]} px{rate}")


def _judge_sync(config: Config, differences_ns: list[int]) -> Finding:
    if config.camera.source != "libcamera-dual":
        return ok("sync", "both eyes come in one frame")
    worst_ms = max(abs(d) for d in differences_ns) / 1e6
    if worst_ms > MAX_OFFSET_MS:
        return finding(
            "sync", "error", f"the eyes' time stamps differ by {worst_ms:.1f} ms",
            "wire the sensors' synchronisation line and set its overlay",
        )  # fmt: skip
    return ok(
        "sync", f"time stamps agree to {worst_ms:.2f} ms (`sweeper calibrate sync` proves it)"
    )


def _judge_rows(config: Config, frames: list[StereoFrame]) -> Iterator[Finding]:
    rectifier = open_calibration(config)
    watch = EpipolarWatch()
    for frame in frames:
        eyes = (frame.left, frame.right)
        watch.look(*(rectifier.rectify(*eyes) if rectifier else eyes))
    if watch.problem:
        yield warn("calibration", watch.problem, "fasten it, then `sweeper calibrate stereo`")


def check_controller(config: Config) -> Iterator[Finding]:
    """It answers, and runs this version's firmware."""
    wheels = open_wheels(config.robot, config.link)
    try:
        state = next(link_states(wheels), None)
        who = wheels.link.controller
    finally:
        wheels.close()
    if state is None or who is None:
        raise no_answer(config, wheels.link.problem)
    latched = f", stopped: {state.stop_reason}" if state.stop_reason else ""
    yield ok("serial", f"the motor controller answers{latched}")
    try:
        board = Board(who.board).name.lower()
    except ValueError:
        yield warn(
            "firmware", f"an unknown board ({who.board})", "flash it: `sweeper wheels flash`"
        )
        return
    ours = build_number(board)
    if who.build != ours:
        yield warn(
            "firmware",
            f"build {who.build:08x} on {board} where this version has {ours:08x}",
            "write the matching one: `sweeper wheels flash`",
        )
    else:
        yield ok("firmware", f"build {who.build:08x} on {board}")


def check_i2c(config: Config) -> Iterator[Finding]:
    """The bus can be opened."""
    open_bus(config.robot.i2c_bus)
    yield ok("i2c", f"/dev/i2c-{config.robot.i2c_bus}")


def check_imu(config: Config) -> Iterator[Finding]:
    """It measures, is mounted as configured, and rests where the robot does."""
    try:
        imu = open_imu(config)
    except HardwareError as problem:
        # The robot goes without a gyro, and turns worse.
        cause, _, remedy = str(problem).partition("; ")
        yield warn("imu", cause, remedy or "connect a gyro")
        return
    wrong = imu.self_test()
    for sentence in wrong:
        cause, _, remedy = sentence.partition("; ")
        yield warn("imu", cause, remedy or "repeat it with the robot at rest")
    if not wrong:
        yield ok("imu", f"{imu.name} at {imu.address:#x}")


def check_battery(config: Config) -> Iterator[Finding]:
    """The gauge, where one is configured."""
    if config.sensors.gauge == "none":
        yield ok("battery", "no gauge: the motor controller's voltage is used")
        return
    gauge = open_battery_gauge(config)
    wrong = gauge.self_test()
    for sentence in wrong:
        cause, _, remedy = sentence.partition("; ")
        yield warn("battery", cause, remedy or "check its wiring")
    if not wrong:
        reading = gauge.read()
        volts = f"{reading.voltage_v:.1f} V" if reading else "set up"
        yield ok("battery", f"{gauge.name}: {volts}")
