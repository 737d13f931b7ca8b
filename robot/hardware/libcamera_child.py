"""The camera's own process: libcamera on the system's Python, frames into shared memory.

Runs as a plain script with nothing but the standard library and Debian's python3-libcamera, so the
runtime's numpy and the system's never meet, and a pipeline that hangs can be killed and started
again. One request on stdin (a byte) is answered by the newest frame: its pixels in the shared
memory, its `RECORD` on stdout. Frames that nobody asked for are never copied. Ends when stdin does.

The API is that of libcamera's Python bindings 0.3 to 0.5. Times are SensorTimestamp, which counts
as CLOCK_BOOTTIME does; they are handed on as CLOCK_MONOTONIC.
"""

from __future__ import annotations

import json
import mmap
import os
import selectors
import struct
import sys
import time
from dataclasses import dataclass, field
from typing import Any

RECORD = struct.Struct("<qqq")  # seq, t_ns, difference of the two eyes' times in ns
READY = -1  # the `seq` of the first record: the cameras have started
TARGET_GREY = 110.0
MAX_AUTO_EXPOSURE_US = 10_000  # longer ones blur what a turning robot sees
MIN_EXPOSURE_US, MAX_GAIN = 100, 16.0
_TELLS = 12  # rows that are looked at for exposure


class Refused(Exception):
    """One sentence for the user."""


@dataclass
class Exposure:
    """One exposure and gain for both eyes; fixed, or led by the left eye's mean grey level."""

    time_us: int
    gain: float
    automatic: bool

    def look(self, mean: float) -> bool:
        """Learn from a frame; True when the values have changed. Time goes first, then gain."""
        if not self.automatic or abs(mean - TARGET_GREY) < 12.0:
            return False
        wanted = self.time_us * self.gain * min(1.6, max(0.6, TARGET_GREY / max(mean, 1.0)))
        time_us = round(min(MAX_AUTO_EXPOSURE_US, max(MIN_EXPOSURE_US, wanted)))
        gain = min(MAX_GAIN, max(1.0, wanted / time_us))
        changed = (time_us, gain) != (self.time_us, self.gain)
        self.time_us, self.gain = time_us, gain
        return changed


@dataclass
class Pairs:
    """Newest completed frames of one or two cameras, matched by the time of their exposure."""

    eyes: int
    tolerance_ns: int
    newest: Any = None  # (frames, t_ns, difference_ns)
    _waiting: list[Any] = field(default_factory=lambda: [None, None])

    def add(self, eye: int, t_ns: int, frame: Any) -> list[Any]:
        """Take a frame; returns those that are no longer needed."""
        if self.eyes == 1:
            return self._keep([frame], t_ns, 0)
        old, self._waiting[eye] = self._waiting[eye], (t_ns, frame)
        spent = [old[1]] if old else []
        left, right = self._waiting
        if left and right and abs(left[0] - right[0]) <= self.tolerance_ns:
            self._waiting = [None, None]
            spent += self._keep([left[1], right[1]], (left[0] + right[0]) // 2, right[0] - left[0])
        return spent

    def take(self) -> Any:
        """The newest pair, once."""
        pair, self.newest = self.newest, None
        return pair

    def _keep(self, frames: list[Any], t_ns: int, difference_ns: int) -> list[Any]:
        spent = self.newest[0] if self.newest else []
        self.newest = (frames, t_ns, difference_ns)
        return list(spent)


class Eye:
    """One libcamera camera with its buffers mapped."""

    def __init__(self, lc: Any, camera: Any, number: int, setting: dict[str, Any]) -> None:
        self.lc, self.camera, self.number = lc, camera, number
        camera.acquire()
        configuration = camera.generate_configuration([lc.StreamRole.Viewfinder])
        self.stream_config = stream = configuration.at(0)
        asked = (setting["width"], setting["height"])
        stream.size = lc.Size(*asked)
        grey_first = [f for f in stream.formats.pixel_formats if str(f) in ("YUV420", "NV12")]
        if not grey_first:
            raise Refused(f"camera '{camera.id}' offers no YUV420 or NV12; choose another camera.")
        stream.pixel_format = grey_first[0]
        configuration.validate()
        got = (stream.size.width, stream.size.height)
        if got != asked:
            raise Refused(
                f"camera '{camera.id}' delivers {got[0]}x{got[1]} px where {asked[0]}x{asked[1]} "
                "are needed; set camera.width_px and camera.height_px, or calibrate at its size."
            )
        camera.configure(configuration)
        self.allocator = lc.FrameBufferAllocator(camera)
        self.allocator.allocate(stream.stream)
        self.known = {str(key).rpartition(".")[2] for key in camera.controls}
        self.maps: dict[int, memoryview] = {}
        self.requests = [self._request(n, b) for n, b in enumerate(self._buffers())]

    def _buffers(self) -> list[Any]:
        return list(self.allocator.buffers(self.stream_config.stream))

    def _request(self, index: int, buffer: Any) -> Any:
        plane = buffer.planes[0]
        whole = mmap.mmap(plane.fd, plane.offset + plane.length, mmap.MAP_SHARED, mmap.PROT_READ)
        self.maps[index] = memoryview(whole)[plane.offset :]
        request = self.camera.create_request(index * 2 + self.number)
        request.add_buffer(self.stream_config.stream, buffer)
        return request

    def start(self, exposure: Exposure, rate_hz: float) -> None:
        """Start streaming with fixed frame duration, exposure and gain, as far as it knows them."""
        period_us = round(1e6 / rate_hz)
        self.camera.start(
            self._controls({"FrameDurationLimits": (period_us, period_us), **_exposed(exposure)})
        )
        for request in self.requests:
            self.camera.queue_request(request)

    def again(self, request: Any, exposure: Exposure | None) -> None:
        """Give a request back to the camera, with new exposure if there is one."""
        request.reuse()
        if exposure is not None:
            for key, value in self._controls(_exposed(exposure)).items():
                request.set_control(key, value)
        self.camera.queue_request(request)

    def grey(self, request: Any) -> memoryview:
        """The luminance plane of a completed request."""
        return self.maps[request.cookie // 2]

    def mean(self, request: Any) -> float:
        """Mean grey level of a sparse sample."""
        plane, stride = self.grey(request), self.stream_config.stride
        size = self.stream_config.size
        rows = range(0, size.height, max(1, size.height // _TELLS))
        sample = [g for y in rows for g in plane[y * stride : y * stride + size.width : 31]]
        return sum(sample) / max(1, len(sample))

    def _controls(self, wanted: dict[str, Any]) -> dict[Any, Any]:
        return {
            getattr(self.lc.controls, name): value
            for name, value in wanted.items()
            if name in self.known
        }


def _exposed(exposure: Exposure) -> dict[str, Any]:
    return {
        "AeEnable": False,
        "ExposureTime": exposure.time_us,
        "AnalogueGain": float(exposure.gain),
    }


def choose(cameras: list[Any], names: list[str]) -> list[Any]:
    """Cameras by number or id, in that order. Raises Refused, naming what there is."""
    there = ", ".join(f"{n}: {c.id}" for n, c in enumerate(cameras)) or "none"
    chosen = []
    for name in names:
        found = [c for n, c in enumerate(cameras) if name in (str(n), c.id)]
        if not found:
            raise Refused(
                f"no camera '{name}' (there are: {there}); set camera.device, and check the "
                "ribbon cable and the dtoverlay in /boot/firmware/config.txt."
            )
        chosen.append(found[0])
    return chosen


class Server:
    """Started cameras, the newest pair, and one exposure for all of them."""

    def __init__(self, lc: Any, setting: dict[str, Any], memory: mmap.mmap) -> None:
        self.lc, self.setting, self.memory = lc, setting, memory
        self.manager = lc.CameraManager.singleton()
        cameras = choose(list(self.manager.cameras), setting["cameras"])
        self.eyes = [Eye(lc, camera, n, setting) for n, camera in enumerate(cameras)]
        automatic = setting["exposure_us"] == 0
        self.exposure = Exposure(setting["exposure_us"] or 5000, setting["gain"], automatic)
        self.pairs = Pairs(len(self.eyes), setting["tolerance_us"] * 1000)
        self.looked = 0
        self.untold = 0  # requests that do not carry the present exposure yet

    def run(self) -> None:
        """Answer requests until stdin ends."""
        for eye in self.eyes:
            eye.start(self.exposure, self.setting["rate_hz"])
        selector = selectors.DefaultSelector()
        selector.register(self.manager.event_fd, selectors.EVENT_READ)
        selector.register(0, selectors.EVENT_READ)
        os.write(1, RECORD.pack(READY, 0, 0))
        wanted = False
        try:
            while True:
                for key, _ in selector.select():
                    if key.fd != 0:
                        self._collect()
                    elif os.read(0, 16):
                        wanted = True
                    else:
                        return
                if wanted and (pair := self.pairs.take()) is not None:
                    wanted = False
                    self._deliver(*pair)
        finally:
            for eye in self.eyes:
                eye.camera.stop()
                eye.camera.release()

    def _collect(self) -> None:
        for request in self.manager.get_ready_requests():
            if request.status != self.lc.Request.Status.Complete:
                continue
            eye = self._eye(request)
            if eye.number == 0:
                self._look(eye, request)
            for spent in self.pairs.add(eye.number, _taken_ns(request), request):
                self._again(spent)

    def _look(self, eye: Eye, request: Any) -> None:
        """Judge the brightness, but only once the last judgement shows in the frames."""
        self.looked += 1
        if self.looked % (2 * len(eye.requests)) == 0 and self.exposure.look(eye.mean(request)):
            self.untold = len(eye.requests) * len(self.eyes)

    def _deliver(self, requests: list[Any], t_ns: int, difference_ns: int) -> None:
        for request in requests:
            _copy(self._eye(request), request, self.setting, self.memory, len(self.eyes))
        seq = requests[0].sequence
        for request in requests:
            self._again(request)
        os.write(1, RECORD.pack(seq, t_ns, difference_ns))

    def _again(self, request: Any) -> None:
        self._eye(request).again(request, self.exposure if self.untold > 0 else None)
        self.untold -= 1

    def _eye(self, request: Any) -> Eye:
        return self.eyes[request.cookie % 2]


def _taken_ns(request: Any) -> int:
    """When the first row was exposed, on the monotonic clock."""
    for key, value in request.metadata.items():
        if str(key).rpartition(".")[2] == "SensorTimestamp":
            asleep_ns = time.clock_gettime_ns(time.CLOCK_BOOTTIME) - time.monotonic_ns()
            return int(value) - asleep_ns
    raise Refused("the camera gives no SensorTimestamp; its frames cannot be timed.")


def _copy(eye: Eye, request: Any, setting: dict[str, Any], memory: mmap.mmap, eyes: int) -> None:
    """One eye's rows into its half of the shared frame; a single camera fills all of it."""
    plane, stride = eye.grey(request), eye.stream_config.stride
    width, height = setting["width"], setting["height"]
    row = width * eyes
    for y in range(height):
        start = y * row + width * eye.number
        memory[start : start + width] = plane[y * stride : y * stride + width]


def main() -> int:
    """`libcamera_child.py SETTING`: SETTING is JSON, see `LibcameraStereo`."""
    setting = json.loads(sys.argv[1])
    try:
        try:
            import libcamera
        except ImportError as error:
            raise Refused(
                f"Python's libcamera cannot be imported ({error}); "
                "`sudo apt install python3-libcamera`."
            ) from None
        size = setting["width"] * len(setting["cameras"]) * setting["height"]
        Server(libcamera, setting, mmap.mmap(setting["memory_fd"], size)).run()
    except (Refused, RuntimeError, OSError) as error:
        print(f"sweeper: {error}", file=sys.stderr, flush=True)
        return 3
    return 0


if __name__ == "__main__":
    sys.exit(main())
