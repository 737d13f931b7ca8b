"""From tracked points to landmarks: who is worth remembering, where it is, and how sure."""

from __future__ import annotations

import numpy as np

from robot.config import PerceptionConfig
from robot.geometry.stereo import StereoCamera
from robot.messages import Landmark
from robot.perception.descriptor import Describer
from robot.perception.floor import FloorPlane
from robot.perception.point_stereo import Points

PATCH_M = 0.30
PATCH_INSIDE = 0.7
MIN_HEIGHT_M = 0.05  # floor texture repeats itself and is seen at a grazing angle
MIN_DISPARITY_PX = 1.0
SIGMA_U_PX = 0.35
SIGMA_D_PX = 0.2
SIGMA_D_SHARE = 0.01  # slanted and curved patches, worse when near
BUCKETS = 10  # columns of the image among which landmarks are spread


class LandmarkMaker:
    """Chooses and measures the landmarks of each frame."""

    def __init__(self, config: PerceptionConfig, camera: StereoCamera) -> None:
        self._config, self._camera = config, camera

    def points(self, points: Points, describer: Describer, floor: FloorPlane) -> list[Landmark]:
        """Old, steady points above the floor as landmarks, best spread over the image.

        Range and bearing are of the point's foot in `base`; their covariance follows from sigmas
        of column and disparity.
        """
        index = self._eligible(points, describer, floor)
        if not len(index):
            return []
        index = index[self._spread(points, index)]
        pixel, disparity = points.pixel[index].astype(np.float64), points.disparity_px[index]
        range_m, bearing_rad, cov = polar(self._camera, pixel, disparity)
        signature = describer.describe(pixel, PATCH_M * disparity / self._camera.baseline_m)
        height = height_m(pixel, disparity, self._camera, floor)
        return [
            Landmark(
                range_m=float(range_m[i]),
                bearing_rad=float(bearing_rad[i]),
                cov=cov[i],
                signature=signature[i].tobytes(),
                kind="point",
                height_m=float(height[i]),
                track_id=int(points.track_id[index[i]]),
            )
            for i in range(len(index))
        ]

    def _eligible(self, points: Points, describer: Describer, floor: FloorPlane) -> np.ndarray:
        camera, d = self._camera, points.disparity_px
        least = camera.focal_px * camera.baseline_m / self._config.landmark_range_m
        with np.errstate(invalid="ignore"):
            good = (points.age >= self._config.landmark_age) & points.steady & (d > least)
            good &= height_m(points.pixel, d, camera, floor) > MIN_HEIGHT_M
        width = PATCH_M * np.nan_to_num(d) / camera.baseline_m
        good &= describer.inside(points.pixel, width, PATCH_INSIDE)
        return np.flatnonzero(good)

    def _spread(self, points: Points, index: np.ndarray) -> np.ndarray:
        """Which of the candidates to hand on: the oldest of every bucket first, in turns.

        Age decides because a landmark that stays the same from frame to frame is worth more than
        a better one that changes.
        """
        bucket = (points.pixel[index, 0] * BUCKETS / self._camera.width_px).astype(int)
        order = np.lexsort((points.track_id[index], -points.age[index], bucket))
        same = bucket[order]
        turn = np.arange(len(order)) - np.searchsorted(same, same)  # rank within its bucket
        chosen = order[np.argsort(turn, kind="stable")][: self._config.max_landmarks]
        return np.sort(chosen)


def polar(
    camera: StereoCamera, pixel: np.ndarray, disparity_px: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Range (n,), bearing (n,) in `base` and their covariance (n, 2, 2) of points with stereo."""
    place = camera.base_from_pixel(pixel[:, 0], pixel[:, 1], disparity_px)[:, :2]
    # Numeric Jacobian: exact enough, and right for any mounting.
    step = 1e-3
    by_u = camera.base_from_pixel(pixel[:, 0] + step, pixel[:, 1], disparity_px)[:, :2] - place
    by_d = camera.base_from_pixel(pixel[:, 0], pixel[:, 1], disparity_px + step)[:, :2] - place
    by_pixel = np.stack([by_u, by_d], axis=-1) / step
    x, y = place[:, 0], place[:, 1]
    range_m = np.hypot(x, y)
    by_place = np.stack(
        [
            np.stack([x / range_m, y / range_m], axis=-1),
            np.stack([-y / range_m**2, x / range_m**2], axis=-1),
        ],
        axis=-2,
    )
    jacobian = by_place @ by_pixel
    variance = np.stack(
        [
            np.full(len(pixel), SIGMA_U_PX**2),
            SIGMA_D_PX**2 + (SIGMA_D_SHARE * disparity_px) ** 2,
        ],
        axis=-1,
    )
    cov = (jacobian * variance[:, None, :]) @ jacobian.transpose(0, 2, 1)
    return range_m, np.arctan2(y, x), cov


def height_m(
    pixel: np.ndarray, disparity_px: np.ndarray, camera: StereoCamera, floor: FloorPlane
) -> np.ndarray:
    """Height (n,) above the floor plane, NaN without disparity."""
    ground = floor.disparity_px(pixel[:, 0] - camera.cx_px, pixel[:, 1] - camera.cy_px)
    return floor.height_m * (1.0 - ground / disparity_px)
