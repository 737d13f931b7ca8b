"""The simulated body: the built-in world around the real firmware, bridge and perception.

Physics runs in steps of 5 ms in lock-step with the motor controller's firmware, which is built for
the host and spoken to over a real pseudo-terminal. Answers of workers (eyes, planner) arrive after
a fixed simulated latency, however long they took, so a seed always gives the same life.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from firmware_bridge.host import HostFirmware, HostInputs
from firmware_bridge.messages import ContactBit
from firmware_bridge.transport import SerialTransport
from robot.body.base import Asked, Recorder
from robot.body.eyes import Eyes
from robot.body.records.newest import Newest
from robot.body.records.observe import TIMES
from robot.config import Config
from robot.hardware.fakes import FakeBuzzer
from robot.hardware.wheels import WheelBridge, make_link
from robot.messages import (
    Answer,
    Beep,
    Command,
    Event,
    ImuSample,
    MissionState,
    Planned,
    PlanOrder,
    Request,
    Tick,
)
from robot.mission.worker import make_answer

if TYPE_CHECKING:
    from robot.sim.base import SimBase
    from robot.sim.world import World

NS = 1_000_000_000
TICK_NS = NS // 50
STEP_NS = NS // 200
SEEN_LATENCY_NS = NS * 15 // 100  # what a Pi needs from exposure to landmarks
PLAN_LATENCY_NS = NS * 3 // 10
START_NS = NS  # the schedule says "start" after a second at rest, which calibrates the gyro
AFTER_END_NS = NS


class SimulatedBody:
    """A robot in a rendered flat. Implements `robot.body.base.Body`."""

    def __init__(
        self,
        config: Config,
        world: World,
        base: SimBase,
        firmware: HostFirmware,
        eyes: Eyes,
        recorder: Recorder,
        *,
        duration_s: float,
        record_frames: bool = False,
        real_time: bool = False,
        start: bool = True,
        control: Asked | None = None,
    ) -> None:
        self._config = config
        self._base_from_scene = world.start.inverse()
        self._base = base
        self._firmware = firmware
        self._eyes = eyes
        self._recorder = recorder
        self._record_frames = record_frames
        self._real_time = real_time
        self._end_ns = int(duration_s * NS)
        self._transport = SerialTransport(firmware.port, config.link.baud)
        link = make_link(self._transport, config.link)
        self._wheels = WheelBridge(link, config.robot, config.link)
        self._frame_ns = int(NS / config.camera.rate_hz)
        self._arrivals_ns: deque[int] = deque()  # of what the eyes are busy with
        self._planned: deque[tuple[int, Planned]] = deque()
        self._yaw_since_frame_rad = 0.0
        self._pwm = (0.0, 0.0)
        self._start = start
        self._control = control
        self.buzzer = FakeBuzzer()
        self._stage_ms: dict[str, Newest] = {}
        self.frames = 0
        self.frames_dropped = 0

    @property
    def stage_ms(self) -> dict[str, np.ndarray]:
        """Wall time in milliseconds (n,) of each stage of a tick."""
        return {stage: times.rows[:, 0] for stage, times in self._stage_ms.items()}

    # ------------------------------------------------------------------ Body

    def events(self) -> Iterator[Event]:
        """Live until the mission has ended, or for the given duration."""
        now_ns, seq = 0, 0
        started_s = time.monotonic()
        while now_ns < self._end_ns:
            now_ns += TICK_NS
            self._advance(now_ns)
            yield from self._sensors(now_ns)
            if now_ns == START_NS and self._start:
                yield Request(now_ns, "start")
            if self._control is not None:
                yield from self._control.poll(now_ns)
            if now_ns % self._frame_ns < TICK_NS:
                self._expose(now_ns, seq)
                seq += 1
            yield from self._answers(now_ns)
            before_ns = time.perf_counter_ns()
            yield Tick(now_ns)
            self._timed("brain_tick", before_ns)
            if self._real_time:
                time.sleep(max(0.0, started_s + now_ns / NS - time.monotonic()))

    def send(self, command: Command) -> None:
        """Drive the world through the serial bridge; plans are made at once and answered later."""
        if isinstance(command, PlanOrder):
            before_ns = time.perf_counter_ns()
            answer = make_answer(command, self._config.planning, self._config.robot)
            self._timed("plan", before_ns)
            self._planned.append((command.t_ns + PLAN_LATENCY_NS, answer))
        elif isinstance(command, Answer):
            if self._control is not None:
                self._control.answer(command)
        elif isinstance(command, Beep):
            self.buzzer.beep(command.t_ns)
        elif isinstance(command, MissionState):
            # Who waits for a start waits for the next one, too.
            if command.state not in ("done", "error") or not self._start:
                return
            self._end_ns = min(self._end_ns, command.t_ns + AFTER_END_NS)
        else:
            self._wheels.send(command)

    def close(self) -> None:
        """Close the serial port; the processes belong to whoever started them."""
        self._transport.close()

    # ------------------------------------------------------------------ parts of a tick

    def _advance(self, now_ns: int) -> None:
        """Physics and firmware in lock-step up to `now_ns`."""
        before_ns = time.perf_counter_ns()
        base = self._base
        for _ in range(TICK_NS // STEP_NS):
            outputs = self._firmware.step(
                STEP_NS // 1000,
                HostInputs(
                    left_ticks=base.left_ticks,
                    right_ticks=base.right_ticks,
                    bump_left=base.bump_left,
                    bump_right=base.bump_right,
                    wheel_drop=base.wheel_drop,
                    charging=base.charging,
                    battery_mv=int(base.battery_v * 1000),
                    current_ma=int(base.motor_current_a * 1000),
                    more_contacts=ContactBit.CLIFF_LEFT * base.cliff_sensors,
                ),
                self._transport.bytes_sent,
            )
            base.step(STEP_NS / NS, outputs.left_pwm, outputs.right_pwm)
        self._transport.read_until(outputs.bytes_sent_by_mcu)
        self._timed("world", before_ns)

    def _sensors(self, now_ns: int) -> Iterator[Event]:
        yield from self._wheels.poll(now_ns)
        sample = ImuSample(now_ns, self._base.yaw_rate_radps())
        self._yaw_since_frame_rad += sample.yaw_rate_radps * TICK_NS / NS
        yield sample

    def _expose(self, now_ns: int, seq: int) -> None:
        """Take a picture: it is drawn and perceived while the world goes on."""
        pose, arrives_ns = self._base.world_from_base, now_ns + SEEN_LATENCY_NS
        self._eyes.expose(now_ns, arrives_ns, seq, pose, self._yaw_since_frame_rad)
        self._arrivals_ns.append(arrives_ns)
        self._yaw_since_frame_rad = 0.0
        self._recorder.truth(now_ns, self._base_from_scene @ pose)

    def _answers(self, now_ns: int) -> Iterator[Event]:
        """What the workers have finished by now."""
        while self._arrivals_ns and self._arrivals_ns[0] <= now_ns:
            self._arrivals_ns.popleft()
            before_ns = time.perf_counter_ns()
            frame, seen = self._eyes.seen()
            self._timed("wait_seen", before_ns)
            if self._record_frames and frame is not None:
                self._recorder.frame(frame)
            self.frames += 1
            before_ns = time.perf_counter_ns()
            yield seen
            self._timed("brain_seen", before_ns)
        while self._planned and self._planned[0][0] <= now_ns:
            arrives_ns, answer = self._planned.popleft()
            yield replace(answer, t_ns=arrives_ns)

    def _timed(self, stage: str, started_ns: int) -> None:
        """Note the wall time of one passage of `stage`, for the summary."""
        times = self._stage_ms.setdefault(stage, Newest(1, TIMES))
        times.append((time.perf_counter_ns() - started_ns) / 1e6)
