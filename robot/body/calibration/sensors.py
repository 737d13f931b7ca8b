"""`sweeper calibrate imu | wheels | camera-pose | sync`: the robot itself is the instrument."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

from robot.body.sources import open_calibration, open_depth, open_imu, open_stereo
from robot.calibrate.mounting import find_mounting
from robot.calibrate.sync import MIN_PAIRS, LightWatch, measure_sync
from robot.calibrate.wheels import Straight, Turn, calibrate_wheels
from robot.config import Config, load_config
from robot.errors import CalibrationError, FrameError, HardwareError
from robot.hardware.frames_folder import FramesFolder
from robot.hardware.imu_i2c import Imu
from robot.messages import StereoFrame

STRAIGHT_M, STRAIGHT_MPS = 1.0, 0.12
TURN_RAD, TURN_RADPS = 4.0 * math.pi, 0.8
MAX_NOISE_RADPS = 0.02
FLOOR_FRAMES = 10


def imu(arguments: argparse.Namespace) -> dict[str, Any]:
    """Bias along the axis that points up; refuses a chip that moves or does not measure."""
    from robot.body.calibration.cameras import apply

    sensor = open_imu(load_config(arguments.config))
    rest = sensor.rest(samples=300)
    up = rest.up
    index, sign = "xyz".index(up[-1]), -1.0 if up.startswith("-") else 1.0
    noise = float(rest.noise_radps[index])
    if not 0.0 < noise < MAX_NOISE_RADPS:
        raise CalibrationError(
            f"the {sensor.name} scatters by {noise:.4f} rad/s where a resting one has more than 0 "
            f"and less than {MAX_NOISE_RADPS}; let the robot stand still, or replace the chip."
        )
    bias = sign * float(rest.gyro_radps[index])
    apply(arguments, {"sensors.imu_axis": up, "sensors.imu_bias_radps": bias})
    return {"name": sensor.name, "axis": up, "bias_radps": bias, "noise_radps": noise}


def camera_pose(arguments: argparse.Namespace) -> dict[str, Any]:
    """Height and pitch for the configuration; roll is told, and corrected by the mount."""
    from robot.body.calibration.cameras import apply

    config = load_config(arguments.config)
    rectifier = open_calibration(config)
    camera = rectifier.camera if rectifier else config.camera.stereo_camera()
    depth = open_depth(config, camera)
    maps = []
    for frame in _frames(arguments, config, FLOOR_FRAMES):
        left, right = rectifier.rectify(frame.left, frame.right) if rectifier else (
            frame.left, frame.right
        )  # fmt: skip
        maps.append(depth.match(left, right).disparity_px)
    found = find_mounting(maps, camera)
    apply(arguments, {"camera.z_m": found.z_m, "camera.pitch_rad": found.pitch_rad})
    if abs(found.roll_rad) > math.radians(1.0) and arguments.json != "-":
        print(f"The cameras lean by {math.degrees(found.roll_rad):.1f} degrees; level the mount.")
    return asdict(found)


def sync(arguments: argparse.Namespace) -> dict[str, Any]:
    """Exit code 2 with a sentence when the eyes are not exposed at once."""
    config = load_config(arguments.config)
    left, right = LightWatch(), LightWatch()
    for frame in _frames(arguments, config, max(MIN_PAIRS, arguments.pairs)):
        left.add(frame.left)
        right.add(frame.right)
    found = measure_sync(left.levels(), right.levels(), arguments.blink_hz)
    if arguments.json != "-":
        print(f"The eyes are exposed {found.offset_ms:.1f} +- {found.sigma_ms:.1f} ms apart.")
    if not found.synchronised:
        raise CalibrationError(
            f"the eyes are exposed {found.offset_ms:.1f} ms apart; wire the sensors' "
            "synchronisation line, or use a camera that delivers both eyes in one frame."
        )
    return asdict(found)


def _frames(arguments: argparse.Namespace, config: Config, count: int) -> Iterator[StereoFrame]:
    """Recorded pairs, or `count` live ones. Raises HardwareError when the camera stops."""
    if arguments.frames is not None:
        folder = FramesFolder(arguments.frames)
        while (frame := folder.read()) is not None:
            yield frame
        return
    camera = open_stereo(config)
    misses = 0
    try:
        while count > 0:
            live = camera.read()
            if live is not None:
                count, misses = count - 1, 0
                yield live
            elif (misses := misses + 1) > 100:
                raise FrameError(f"the camera stopped ({camera.problem}); replug it.")
    finally:
        camera.close()


def wheels(arguments: argparse.Namespace) -> dict[str, Any]:
    """Drives a metre forward, asks for the tape's word, turns twice on the spot."""
    from robot.body.calibration.cameras import apply
    from robot.body.wheels import _open, confirm

    config = load_config(arguments.config)
    if not (arguments.yes or confirm("The robot drives a metre forward, then turns twice.")):
        raise HardwareError("the drive was not confirmed; say `yes`, or pass --yes.")
    drive = CalibrationDrive(_open(config), open_imu(config), config)
    try:
        drive.begin()
        left, right, turned = drive.straight(STRAIGHT_M)
        measured_m = arguments.measured_m or _ask("How far has it driven, in metres? ")
        straight = Straight(left, right, measured_m, turned)
        turn = Turn(*drive.turn(TURN_RAD))
    finally:
        drive.end()
    found = calibrate_wheels(
        straight, turn, config.link.metres_per_tick, config.robot.track_width_m
    )
    apply(
        arguments,
        {
            "link.metres_per_tick": found.metres_per_tick,
            "robot.track_width_m": found.track_width_m,
        },
    )
    return asdict(found)


class CalibrationDrive:
    """Slow drives by hand of the link, with the gyro integrated meanwhile."""

    def __init__(self, live: Any, gyro: Imu, config: Config) -> None:
        self._live, self._gyro, self._config = live, gyro, config
        self._bias = 0.0
        self._turned = 0.0
        self._last_ns = 0

    def begin(self) -> None:
        """Connect, clear a latched stop, and learn the gyro's bias at rest."""
        self._live.connect()
        self._live.wait(0.1)
        if not self._live.clear():
            raise HardwareError(
                f"the controller is stopped ('{self._live.link.stop_reason.name.lower()}'); "
                "remove its cause."
            )
        rates: list[float] = []

        def listen() -> bool:
            sample = self._gyro.read()
            if sample is not None:
                rates.append(sample.yaw_rate_radps)
            return False

        self._live.wait(2.0, until=listen)
        if len(rates) < 20:
            raise HardwareError("the gyro does not answer; see `sweeper check`.")
        self._bias = sum(rates) / len(rates)

    def straight(self, metres: float) -> tuple[int, int, float]:
        """Ticks of both wheels, and the angle turned meanwhile."""
        speed = STRAIGHT_MPS
        return self._drive(speed, speed, lambda: False, metres / speed)

    def turn(self, angle_rad: float) -> tuple[int, int, float]:
        """The same for turning to the left on the spot."""
        speed = TURN_RADPS * self._config.robot.track_width_m / 2.0
        longest_s = 1.5 * angle_rad / TURN_RADPS
        return self._drive(-speed, speed, lambda: self._turned >= angle_rad, longest_s)

    def end(self) -> None:
        """Stop, whatever happened."""
        self._live.stop()
        self._live.link.close()

    def _drive(
        self, left: float, right: float, until: Any, seconds: float
    ) -> tuple[int, int, float]:
        from firmware_bridge.messages import Drive

        self._live.clear()
        start = self._live.ticks()
        self._turned, self._last_ns = 0.0, 0

        def step() -> bool:
            return self._integrate() or until() or self._live.latched()

        self._live.wait(seconds, Drive(round(left * 1000), round(right * 1000), 0, 0, 200), step)
        if self._live.latched():
            reason = self._live.link.stop_reason.name.lower()
            raise HardwareError(f"the drive was cut short ('{reason}'); clear the way, start anew.")
        # Roll out under a standing order: a latched stop would end the session's counting early.
        self._live.wait(1.0, Drive(0, 0, 0, 0, 200), self._integrate)
        end = self._live.ticks()
        return end[0] - start[0], end[1] - start[1], self._turned

    def _integrate(self) -> bool:
        """Add one sample; never a reason to stop."""
        sample = self._gyro.read()
        if sample is None:
            return False
        if self._last_ns:
            passed_s = (sample.t_ns - self._last_ns) / 1e9
            self._turned += (sample.yaw_rate_radps - self._bias) * passed_s
        self._last_ns = sample.t_ns
        return False


def _ask(question: str) -> float:
    """A number from the terminal. Raises CalibrationError when nobody answers with one."""
    if not sys.stdin.isatty():
        raise CalibrationError("nobody is at the terminal; give the distance in --measured-m.")
    try:
        return float(input(question).strip().replace(",", "."))
    except ValueError:
        raise CalibrationError("that is no number; start again, and answer like 0.98.") from None
