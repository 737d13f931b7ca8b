"""A stereo camera that delivers both eyes side by side in one frame: USB (UVC) or a video file.

One exposure, one frame: the eyes cannot drift apart in time. The driver's queue is kept at one
frame, so a slow reader always gets the newest.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import cv2
import numpy as np

from robot.errors import FrameError, HardwareError
from robot.messages import StereoFrame


class UvcStereo:
    """Reads side-by-side frames through OpenCV. Not thread-safe: one reader.

    Raises HardwareError when the device cannot be opened, or delivers another width than asked.
    """

    def __init__(
        self,
        device: str,
        *,
        eye_width_px: int,
        eye_height_px: int,
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self._clock = clock
        self._device = device
        self._seq = 0
        self._capture = cv2.VideoCapture(int(device) if device.isdigit() else device)
        if not self._capture.isOpened():
            raise HardwareError(
                f"camera.device = '{device}': no camera there; "
                "list them with `ls /dev/video*` and set camera.device."
            )
        self._capture.set(cv2.CAP_PROP_FRAME_WIDTH, 2 * eye_width_px)
        self._capture.set(cv2.CAP_PROP_FRAME_HEIGHT, eye_height_px)
        self._capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)

    def read(self) -> StereoFrame | None:
        """Wait for the next pair; None when the device has stopped delivering."""
        ok, image = self._capture.read()
        t_ns = self._clock()
        if not ok:
            return None
        left, right = split_side_by_side(image, self._device)
        frame = StereoFrame(t_ns, self._seq, left, right)
        self._seq += 1
        return frame

    def close(self) -> None:
        """Give the device back."""
        self._capture.release()


def split_side_by_side(image: np.ndarray, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Cut one frame (h, 2w) or (h, 2w, 3) into two contiguous grey eyes (h, w) uint8.

    Raises FrameError when the frame is not as wide as two eyes.
    """
    if image.dtype != np.uint8 or image.ndim not in (2, 3) or image.shape[1] % 2:
        raise FrameError(
            f"{name}: a frame of shape {image.shape} and type {image.dtype} is not two 8-bit eyes "
            "side by side; choose a side-by-side mode of the camera."
        )
    grey = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    half = grey.shape[1] // 2
    return np.ascontiguousarray(grey[:, :half]), np.ascontiguousarray(grey[:, half:])
