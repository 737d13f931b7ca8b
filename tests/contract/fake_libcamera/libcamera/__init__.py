"""libcamera's Python API as the runtime uses it, with the library's rules and no camera.

Cameras take frames in threads. A call in the wrong state raises, as the real one does. What the
cameras do is said in the environment: FAKE_LIBCAMERA, JSON of `Behaviour`.
"""

import enum
import json
import os
import threading
import time
from dataclasses import dataclass, field


@dataclass
class Behaviour:
    cameras: int = 1
    size: list = field(default_factory=list)  # the only one there is; empty: any
    period_s: float = 0.02
    silent_after: int = -1  # frames; the pipeline then hangs
    skew_us: int = 0  # of the second camera
    stride_extra: int = 32
    grey: int = 60  # at 5 ms and gain 1


BEHAVIOUR = Behaviour(**json.loads(os.environ.get("FAKE_LIBCAMERA", "{}")))


class Size:
    def __init__(self, width, height):
        self.width, self.height = width, height


class StreamRole(enum.Enum):
    Viewfinder = 1


class _ControlId:
    def __init__(self, name):
        self._name = name

    def __str__(self):
        return self._name


class controls:
    AeEnable = _ControlId("AeEnable")
    ExposureTime = _ControlId("ExposureTime")
    AnalogueGain = _ControlId("AnalogueGain")
    FrameDurationLimits = _ControlId("FrameDurationLimits")
    SensorTimestamp = _ControlId("SensorTimestamp")


class _Formats:
    pixel_formats = ("XRGB8888", "NV12")


class _StreamConfig:
    formats = _Formats()

    def __init__(self):
        self.size, self.pixel_format, self.stride, self.stream = Size(1640, 1232), "", 0, object()


class _Configuration:
    def __init__(self):
        self._stream = _StreamConfig()

    def at(self, index):
        assert index == 0
        return self._stream

    def validate(self):
        if BEHAVIOUR.size:
            self._stream.size = Size(*BEHAVIOUR.size)
        self._stream.stride = self._stream.size.width + BEHAVIOUR.stride_extra


class _Plane:
    def __init__(self, fd, offset, length):
        self.fd, self.offset, self.length = fd, offset, length


class _Buffer:
    def __init__(self, length):
        fd = os.memfd_create("frame")
        os.ftruncate(fd, 4096 + length)
        self.planes = [_Plane(fd, 4096, length), _Plane(fd, 4096, 0)]


class FrameBufferAllocator:
    def __init__(self, camera):
        self._camera, self._buffers = camera, []

    def allocate(self, stream):
        assert self._camera.configured is not None, "allocate before configure"
        config = self._camera.configured
        self._buffers = [_Buffer(config.stride * config.size.height) for _ in range(4)]
        return 4

    def buffers(self, stream):
        return self._buffers


class Request:
    class Status(enum.Enum):
        Pending = 0
        Complete = 1
        Cancelled = 2

    def __init__(self, cookie):
        self.cookie, self.status, self.sequence = cookie, Request.Status.Pending, 0
        self.metadata, self.buffer, self.given, self._fresh = {}, None, {}, True

    def add_buffer(self, stream, buffer):
        self.buffer = buffer

    def reuse(self):
        assert self.status is Request.Status.Complete, "reuse of a request that is under way"
        self.status, self._fresh, self.given = Request.Status.Pending, True, {}

    def set_control(self, key, value):
        assert self._fresh, "controls come after reuse"
        self.given[str(key)] = value


class _Camera:
    def __init__(self, manager, number):
        self.id, self._manager, self.number = f"/base/fake@{number}", manager, number
        self.controls = [controls.AeEnable, controls.ExposureTime, controls.AnalogueGain]
        self.acquired, self.configured, self.running = False, None, False
        self.queue, self.lock = [], threading.Lock()
        self.exposure_us, self.gain = 5000, 1.0

    def acquire(self):
        assert not self.acquired, "acquired twice"
        self.acquired = True

    def release(self):
        assert not self.running, "released while running"
        self.acquired = False

    def generate_configuration(self, roles):
        return _Configuration()

    def configure(self, configuration):
        assert self.acquired, "configure before acquire"
        self.configured = configuration.at(0)

    def create_request(self, cookie):
        return Request(cookie)

    def queue_request(self, request):
        assert self.running, "queued before start"
        assert request.status is Request.Status.Pending, "queued without reuse"
        with self.lock:
            assert request not in self.queue, "queued twice"
            self.queue.append(request)

    def start(self, given):
        unknown = {str(k) for k in given} - {str(k) for k in self.controls}
        assert not unknown, f"unknown controls {unknown}"
        self._apply({str(k): v for k, v in given.items()})
        self.running = True
        threading.Thread(target=self._stream, daemon=True).start()

    def stop(self):
        self.running = False

    def _apply(self, given):
        self.exposure_us = given.get("ExposureTime", self.exposure_us)
        self.gain = given.get("AnalogueGain", self.gain)

    def _stream(self):
        sequence = -1
        while self.running:
            # Sensors of one synchronisation line: all expose at the same beats of the clock.
            period_ns = round(BEHAVIOUR.period_s * 1e9)
            now_ns = time.clock_gettime_ns(time.CLOCK_BOOTTIME)
            beat_ns = (now_ns // period_ns + 1) * period_ns
            time.sleep((beat_ns - now_ns) / 1e9)
            sequence += 1
            if sequence == BEHAVIOUR.silent_after:
                return
            with self.lock:
                request = self.queue.pop(0) if self.queue else None
            if request is not None:
                self._expose(request, sequence, beat_ns)
                self._manager.complete(request)

    def _expose(self, request, sequence, beat_ns):
        self._apply(request.given)
        config, plane = self.configured, request.buffer.planes[0]
        light = self.exposure_us * self.gain / 5000.0
        level = min(250, round(BEHAVIOUR.grey * light))
        half = config.size.width // 2
        row = bytes([level]) * half + bytes([max(0, level - 20)]) * (config.size.width - half)
        os.pwrite(plane.fd, (row + b"\xff" * BEHAVIOUR.stride_extra) * config.size.height,
                  plane.offset)  # fmt: skip
        skew_ns = BEHAVIOUR.skew_us * 1000 * self.number
        exposed_ns = beat_ns - 3_000_000 - skew_ns
        request.metadata = {controls.SensorTimestamp: exposed_ns}
        request.sequence, request.status = sequence, Request.Status.Complete


class CameraManager:
    _one = None

    @classmethod
    def singleton(cls):
        cls._one = cls._one or cls()
        return cls._one

    def __init__(self):
        self.event_fd = os.eventfd(0, os.EFD_NONBLOCK)
        self.cameras = [_Camera(self, n) for n in range(max(0, BEHAVIOUR.cameras))]
        self._done, self._lock = [], threading.Lock()

    def complete(self, request):
        with self._lock:
            self._done.append(request)
        os.eventfd_write(self.event_fd, 1)

    def get_ready_requests(self):
        try:
            os.eventfd_read(self.event_fd)
        except BlockingIOError:
            return []
        with self._lock:
            done, self._done = self._done, []
        return done
