"""A stereo camera that delivers both eyes side by side in one frame: USB (UVC) or a video file.

One exposure, one frame: the eyes cannot drift apart in time. The driver's queue is kept at one
frame, so a slow reader always gets the newest.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import cv2

from robot.errors import FrameError, HardwareError
from robot.hardware.stereo import split_side_by_side
from robot.messages import StereoFrame

_MANUAL, _AUTOMATIC = 1, 3  # V4L2_CID_EXPOSURE_AUTO: manual, aperture priority
_SIZE = (cv2.CAP_PROP_FRAME_HEIGHT, cv2.CAP_PROP_FRAME_WIDTH)
_OLDEST_S = 1.0  # a driver's stamp older than this is of another clock


class UvcStereo:
    """Reads side-by-side frames through OpenCV. Not thread-safe: one reader.

    `exposure_us` 0 leaves exposure and gain to the camera, which sets one for both eyes.
    Raises HardwareError when the device cannot be opened, or has not the size that is asked.
    """

    def __init__(
        self,
        device: str,
        *,
        eye_width_px: int,
        eye_height_px: int,
        rate_hz: float = 0.0,
        exposure_us: int = 0,
        gain: float = 1.0,
        timeout_s: float = 1.0,
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self._clock = clock
        self._device = device
        self._shape = (eye_height_px, eye_width_px)
        self._seq = 0
        number = device.removeprefix("/dev/video")
        live = number.isdigit()
        cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_ERROR)  # it is said below, once
        backend = cv2.CAP_V4L2 if live else cv2.CAP_ANY
        self._capture = cv2.VideoCapture(int(number) if live else device, backend)
        if not self._capture.isOpened():
            raise HardwareError(
                f"camera.device = '{device}': no camera there; "
                "list them with `ls /dev/video*` and set camera.device."
            )
        self._stamped = live
        if live:
            self._ask(rate_hz, exposure_us, gain, timeout_s)

    def _ask(self, rate_hz: float, exposure_us: int, gain: float, timeout_s: float) -> None:
        """Ask the driver, which ignores what it does not know. Raises HardwareError."""
        wishes = [
            # Two eyes uncompressed do not fit USB 2 at every size; cameras know Motion JPEG.
            (cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*"MJPG")),
            (cv2.CAP_PROP_FRAME_WIDTH, 2 * self._shape[1]),
            (cv2.CAP_PROP_FRAME_HEIGHT, self._shape[0]),
            (cv2.CAP_PROP_BUFFERSIZE, 1),
            (cv2.CAP_PROP_READ_TIMEOUT_MSEC, 1000.0 * timeout_s),
            (cv2.CAP_PROP_AUTO_EXPOSURE, _MANUAL if exposure_us else _AUTOMATIC),
        ]
        if rate_hz:
            wishes.append((cv2.CAP_PROP_FPS, rate_hz))
        if exposure_us:
            wishes += [(cv2.CAP_PROP_EXPOSURE, exposure_us / 100.0), (cv2.CAP_PROP_GAIN, gain)]
        for key, value in wishes:
            self._capture.set(key, value)
        height, width = (round(self._capture.get(key)) for key in _SIZE)
        if (height, width) != (self._shape[0], 2 * self._shape[1]):
            self._capture.release()
            raise HardwareError(self._wrong_size(width // 2, height))

    def read(self) -> StereoFrame | None:
        """Wait for the next pair; None when the device has stopped delivering.

        Raises FrameError when it delivers another size than asked.
        """
        ok, image = self._capture.read()
        arrived_ns = self._clock()
        if not ok:
            return None
        left, right = split_side_by_side(image, self._device)
        if left.shape != self._shape:
            raise FrameError(self._wrong_size(left.shape[1], left.shape[0]))
        frame = StereoFrame(self._taken_ns(arrived_ns), self._seq, left, right)
        self._seq += 1
        return frame

    def _wrong_size(self, width_px: int, height_px: int) -> str:
        return (
            f"camera.device = '{self._device}' delivers eyes of {width_px}x{height_px} px where "
            f"{self._shape[1]}x{self._shape[0]} px are needed; calibrate at a size it offers, see "
            "`v4l2-ctl --list-formats-ext`."
        )

    def _taken_ns(self, arrived_ns: int) -> int:
        """The driver's stamp of the frame's start where it gives one, else the arrival."""
        if not self._stamped:
            return arrived_ns
        stamp_ns = round(self._capture.get(cv2.CAP_PROP_POS_MSEC) * 1e6)
        return stamp_ns if 0 <= arrived_ns - stamp_ns < _OLDEST_S * 1e9 else arrived_ns

    def close(self) -> None:
        """Give the device back."""
        self._capture.release()
