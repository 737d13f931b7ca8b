"""From raw pair to rectified pair of the working size, in one remap per eye."""

from __future__ import annotations

import cv2
import numpy as np

from robot.errors import CalibrationError, FrameError
from robot.geometry.stereo import StereoCamera
from robot.perception.calibration import Eye, StereoCalibration

MIN_SEEN = 0.9  # of the working image, by both eyes


class Rectifier:
    """Lookup tables that undistort, rotate, crop and scale both eyes at once.

    The working image is filled: it is the largest part of the rectified view, of the working
    aspect, that both eyes see entirely (`cv2.stereoRectify` with alpha 0). Pixels stay square and
    nothing is invented; what does not fit the aspect is cropped. Rectification follows Bouguet as
    implemented there; the two principal points coincide.

    A frame that is shrunk by two or more is first averaged down by a whole factor, so that the
    bilinear remap does not alias.
    """

    def __init__(
        self,
        calibration: StereoCalibration,
        width_px: int,
        height_px: int,
        base_from_cam: np.ndarray,
    ) -> None:
        """`base_from_cam` (4, 4) is the mounting of the rectified left eye.

        Raises CalibrationError when no common view of that size exists.
        """
        left, right = calibration.left, calibration.right
        self._raw_size = (left.width_px, left.height_px)
        pose = calibration.right_from_left
        r_left, r_right, p_left, p_right, _, *seen = cv2.stereoRectify(
            left.matrix,
            left.distortion,
            right.matrix,
            right.distortion,
            self._raw_size,
            pose[:3, :3],
            pose[:3, 3:4],
            flags=cv2.CALIB_ZERO_DISPARITY,
            alpha=0.0,
            newImageSize=(width_px, height_px),
        )
        focal, cx, cy = p_left[0, 0], p_left[0, 2], p_left[1, 2]
        baseline = -p_right[0, 3] / p_right[0, 0]
        least = MIN_SEEN * width_px * height_px
        sane = np.all(np.isfinite(p_left)) and np.all(np.isfinite(p_right)) and baseline > 0.0
        if not sane or min(width * height for _, _, width, height in seen) < least:
            raise CalibrationError(
                f"{calibration.name}: the two eyes share no view that can be rectified; "
                "check distortion and extrinsics, or calibrate again."
            )
        self.camera = StereoCamera(
            width_px, height_px, float(focal), float(cx), float(cy), float(baseline), base_from_cam
        )
        scale = focal / max(left.matrix[0, 0], left.matrix[1, 1])
        self._shrink = max(1, int(1.0 / scale + 1e-6))
        self._maps = (
            self._make_maps(left, r_left, p_left),
            self._make_maps(right, r_right, p_right),
        )

    @property
    def raw_size_px(self) -> tuple[int, int]:
        """Width and height of each eye's picture before rectification."""
        return self._raw_size

    def rectify(self, left: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rectified grey uint8 pair (height, width). Raises FrameError for a wrong frame size."""
        return self._remap(left, 0, "left"), self._remap(right, 1, "right")

    def _remap(self, image: np.ndarray, eye: int, side: str) -> np.ndarray:
        width, height = self._raw_size
        check_image(image, width, height, side, "give the calibration of this camera and size")
        if self._shrink > 1:
            small = (width // self._shrink, height // self._shrink)
            image = image[: small[1] * self._shrink, : small[0] * self._shrink]
            image = cv2.resize(image, small, interpolation=cv2.INTER_AREA)
        fixed, fraction = self._maps[eye]
        return cv2.remap(image, fixed, fraction, cv2.INTER_LINEAR)

    def _make_maps(
        self, eye: Eye, rotation: np.ndarray, projection: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        size = (self.camera.width_px, self.camera.height_px)
        u, v = cv2.initUndistortRectifyMap(
            eye.matrix, eye.distortion, rotation, projection[:, :3], size, cv2.CV_32FC1
        )
        # Centre of pixel 0 is at 0, so averaging blocks of n moves u to (u + 0.5) / n - 0.5.
        u, v = ((m + 0.5) / self._shrink - 0.5 for m in (u, v))
        return cv2.convertMaps(u, v, cv2.CV_16SC2)


def check_image(image: np.ndarray, width_px: int, height_px: int, side: str, remedy: str) -> None:
    """Raise FrameError unless `image` is grey uint8 of that size."""
    if image.dtype != np.uint8 or image.ndim != 2:
        raise FrameError(
            f"the {side} image is {image.dtype} with {image.ndim} axes; give grey 8-bit images."
        )
    if image.shape != (height_px, width_px):
        raise FrameError(
            f"the {side} image is {image.shape[1]}x{image.shape[0]} px where "
            f"{width_px}x{height_px} px is expected; {remedy}."
        )
