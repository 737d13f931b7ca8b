"""The live body: cameras, gyro and the motor controller, on the monotonic clock.

One thread captures and sees; one thread plans; the loop's own thread polls the serial link and the
gyro, and never waits for either. Answers of the workers are events.
"""

from __future__ import annotations

import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Protocol

import numpy as np

from robot.body.base import Asked, Recorder
from robot.body.notify import Notifier
from robot.config import Config
from robot.hardware.button import Button, verb_of
from robot.hardware.buzzer import Buzzer
from robot.hardware.wheels import WheelBridge
from robot.messages import (
    Answer,
    Battery,
    Beep,
    Command,
    Event,
    ImuSample,
    MissionState,
    Planned,
    PlanOrder,
    Request,
    Seen,
    StereoFrame,
    Tick,
)
from robot.mission.worker import make_answer

NS = 1_000_000_000
TICK_NS = NS // 50
REST_NS = 2 * NS  # at rest before a start, for the gyro's bias
FEED_NS, STATUS_NS, GAUGE_NS = NS // 2, NS, NS
# A worker that is silent for longer hangs: a camera may take long to come back, a plan to be made.
PATIENCE_NS = {"see": 40 * NS, "plan": 120 * NS}


class StereoSource(Protocol):
    """A camera: blocking read of the newest pair, None when it has stopped."""

    def read(self) -> StereoFrame | None: ...

    def close(self) -> None: ...


class See(Protocol):
    """The perception chain."""

    def see(self, frame: StereoFrame, arrived_ns: int) -> Seen: ...


class Gyro(Protocol):
    """A turn-rate sensor read on demand."""

    def read(self) -> ImuSample | None: ...


class Gauge(Protocol):
    """A battery gauge read on demand."""

    def read(self) -> Battery | None: ...


class YawTrack:
    """Integral of the gyro over the last seconds, asked by the capture thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._samples: deque[tuple[int, float]] = deque(maxlen=200)  # (t_ns, yaw since start)

    def add(self, sample: ImuSample) -> None:
        """Integrate one sample."""
        with self._lock:
            t_ns, yaw = self._samples[-1] if self._samples else (sample.t_ns, 0.0)
            yaw += sample.yaw_rate_radps * (sample.t_ns - t_ns) / NS
            self._samples.append((sample.t_ns, yaw))

    def change_rad(self, start_ns: int, end_ns: int) -> float:
        """Yaw between two times; NaN where the samples do not reach back that far."""
        with self._lock:
            samples = list(self._samples)
        if not samples or samples[0][0] > start_ns:
            return float("nan")
        at = [
            max((s for s in samples if s[0] <= t), key=lambda s: s[0]) for t in (start_ns, end_ns)
        ]
        return at[1][1] - at[0][1]


class Worker(threading.Thread):
    """Runs `step` until stopped; an exception ends the thread and is kept for the loop to raise."""

    def __init__(
        self, name: str, step: Callable[[], None], clock: Callable[[], int] = time.monotonic_ns
    ) -> None:
        super().__init__(name=name, daemon=True)
        self._step, self._clock = step, clock
        self.beat_ns = clock()
        self._stopping = threading.Event()
        self.error: BaseException | None = None

    def run(self) -> None:
        """Thread body."""
        try:
            while not self._stopping.is_set():
                self.beat_ns = self._clock()
                self._step()
        except BaseException as error:
            self.error = error

    def stop(self) -> None:
        """Ask the thread to end after its present step."""
        self._stopping.set()


class LiveBody:
    """The robot itself. Implements `robot.body.base.Body`."""

    def __init__(
        self,
        config: Config,
        camera: StereoSource,
        perception: See,
        wheels: WheelBridge,
        *,
        gyro: Gyro | None = None,
        gauge: Gauge | None = None,
        control: Asked | None = None,
        recorder: Recorder | None = None,
        notifier: Notifier | None = None,
        duration_s: float = float("inf"),
        start: bool = True,
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self._config, self._camera, self._perception = config, camera, perception
        self._wheels, self._gyro, self._control = wheels, gyro, control
        self._recorder, self._notifier, self._clock = recorder, notifier or Notifier(""), clock
        self._duration_s = duration_s
        self._buzzer = Buzzer(config.robot.buzzer)
        self._button, self._state = Button(config.robot.button), ""
        self._gauge, self._gauge_due_ns, self._gauged_ns = gauge, 0, -(10**18)
        self._feed_due_ns = self._status_due_ns = 0
        self._yaw = YawTrack()
        self._last_frame_ns = 0
        self._blind = ""  # why the last frame told nothing
        self._last_seq = -1
        self._seen: queue.SimpleQueue[Seen] = queue.SimpleQueue()
        self._orders: queue.Queue[PlanOrder] = queue.Queue()
        self._planned: queue.SimpleQueue[Planned] = queue.SimpleQueue()
        self._workers = [
            Worker("see", self._see_one, clock),
            Worker("plan", self._plan_one, clock),
        ]
        self.frames = 0
        self.frames_dropped = 0
        self._start = start
        self.stage_ms: dict[str, np.ndarray] = {}  # nothing but perception's is timed

    # ------------------------------------------------------------------ Body

    def events(self) -> Iterator[Event]:
        """Live until `duration_s` has passed, or a worker has failed (its error is raised)."""
        for worker in self._workers:
            worker.start()
        self._notifier.send("READY=1")
        start_ns = due_ns = self._clock()
        while due_ns - start_ns < self._duration_s * NS:
            due_ns += TICK_NS
            time.sleep(max(0.0, (due_ns - self._clock()) / NS))
            yield from self._inputs(self._clock())
            if self._start and due_ns - start_ns >= REST_NS:
                self._start = False
                yield Request(self._clock(), "start")
            yield Tick(self._clock())
            self._notify(self._clock())
            for worker in self._workers:
                if worker.error is not None:
                    raise worker.error

    def send(self, command: Command) -> None:
        """Hand orders to the motor controller and plans to the planning thread."""
        if isinstance(command, PlanOrder):
            self._orders.put(command)
        elif isinstance(command, Answer):
            if self._control is not None:
                self._control.answer(command)
        elif isinstance(command, MissionState):
            self._state = command.state
        elif isinstance(command, Beep):
            self._buzzer.beep(self._clock())
        else:
            self._wheels.send(command)

    def close(self) -> None:
        """Stop the threads and give the devices back."""
        self._notifier.send("STOPPING=1")
        for worker in self._workers:
            worker.stop()
        for worker in self._workers:
            if worker.is_alive():
                worker.join(timeout=2.0)
        self._camera.close()
        self._button.close()
        if self._control is not None:
            self._control.close()

    # ------------------------------------------------------------------ parts

    def _notify(self, now_ns: int) -> None:
        """Feed the watchdog while everything lives; say once a second how it is."""
        hung = [w.name for w in self._workers if now_ns - w.beat_ns > PATIENCE_NS[w.name]]
        if now_ns >= self._feed_due_ns and not hung:
            self._feed_due_ns = now_ns + FEED_NS
            self._notifier.send("WATCHDOG=1")
        if now_ns >= self._status_due_ns:
            self._status_due_ns = now_ns + STATUS_NS
            self._notifier.send("STATUS=" + ("; ".join(self.problems()) or "ok"))

    def problems(self) -> list[str]:
        """What is wrong with the devices now: the code of `sweeper check`, and the cause."""
        devices = {
            "camera": self._camera,
            "calibration": self._perception,
            "imu": self._gyro,
            "battery": self._gauge,
        }
        said = {code: getattr(device, "problem", "") for code, device in devices.items()}
        said["perception"] = self._blind
        return [f"{code}: {problem}" for code, problem in said.items() if problem]

    def _inputs(self, now_ns: int) -> Iterator[Event]:
        self._buzzer.poll(now_ns)
        if (press := self._button.poll(now_ns)) is not None:
            yield Request(now_ns, verb_of(press, self._state))
        for event in self._wheels.poll(now_ns):
            # The gauge knows better than the motor controller's voltage divider, while it answers.
            if not (isinstance(event, Battery) and now_ns - self._gauged_ns < 5 * GAUGE_NS):
                yield event
        if self._gauge is not None and now_ns >= self._gauge_due_ns:
            self._gauge_due_ns = now_ns + GAUGE_NS
            if (battery := self._gauge.read()) is not None:
                self._gauged_ns = now_ns
                yield battery
        if self._gyro is not None and (sample := self._gyro.read()) is not None:
            self._yaw.add(sample)
            yield sample
        while not self._seen.empty():
            yield self._seen.get()
        while not self._planned.empty():
            yield replace(self._planned.get(), t_ns=now_ns)
        if self._control is not None:
            yield from self._control.poll(now_ns)

    def _see_one(self) -> None:
        frame = self._camera.read()
        if frame is None:
            # A camera that has stopped shows as stale sight in the safety gate; keep asking.
            time.sleep(0.05)
            return
        turned_rad = self._yaw.change_rad(self._last_frame_ns, frame.t_ns)
        frame = replace(frame, yaw_change_rad=turned_rad)
        if self._recorder is not None:
            self._recorder.frame(frame)
        try:
            seen = self._perception.see(frame, frame.t_ns)
        except Exception as error:  # a network that fails blinds the robot, which then goes home
            self._blind = f"frame {frame.seq} could not be perceived ({error!r})"
            return
        self._blind = ""
        self._seen.put(replace(seen, arrived_ns=self._clock()))
        self.frames += 1
        self.frames_dropped += frame.seq - self._last_seq - 1
        self._last_seq, self._last_frame_ns = frame.seq, frame.t_ns

    def _plan_one(self) -> None:
        try:
            order = self._orders.get(timeout=0.2)
        except queue.Empty:
            return
        while not self._orders.empty():  # newest wins, of paths and of rooms
            newer = self._orders.get()
            if (newer.kind == "rooms") != (order.kind == "rooms"):
                self._answer(order)
            order = newer
        self._answer(order)

    def _answer(self, order: PlanOrder) -> None:
        self._planned.put(make_answer(order, self._config.planning, self._config.robot))
