"""Corners followed from frame to frame.

Shi-Tomasi corners (CVPR 1994) followed by pyramidal Lucas-Kanade (Bouguet 2000), started where
the robot's motion puts them, and followed back again as a check.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from robot.config import PerceptionConfig
from robot.geometry.stereo import StereoCamera

SPACING_PX = 8
BORDER_PX = 7
BLOCK_PX = 5
CORNER_PER_NOISE2 = 1.5e-5  # least eigenvalue (OpenCV's scale) per squared grey level of noise
BACK_PX = 0.5  # a point must come back to where it started
UPPER_SHARE = 0.65  # of the tracks are kept for what stands above the floor
# Windows are multiples of four wide: what is left over is not done by the processor's vectors.
WINDOW_PX = (16, 15)
BACK_WINDOW_PX = (16, 7)
STOP = (3, 10, 0.02)  # by count and by epsilon
TOLD_LEVELS, BLIND_LEVELS = 1, 2  # of the pyramid: shifts of about 12 and 25 px are caught
CORNER_STOP = (3, 8, 0.03)
MAX_SHARPEN_PX = 1.5  # a corner that moves farther was another one


@dataclass(frozen=True, slots=True, eq=False)
class Tracks:
    """Points of one frame: pixels (n, 2) float32, the number (n,) of each, frames followed (n,)."""

    pixel: np.ndarray
    track_id: np.ndarray
    age: np.ndarray


class Tracker:
    """Follows points; `ids` hands out numbers that are never used twice."""

    def __init__(self, config: PerceptionConfig, camera: StereoCamera, ids: TrackIds) -> None:
        self._config, self._camera, self._ids = config, camera, ids
        self._last: np.ndarray | None = None
        self._upper_first = False
        self._tracks = Tracks(
            np.empty((0, 2), np.float32), np.empty(0, np.int64), np.empty(0, np.int64)
        )

    def follow(
        self, image: np.ndarray, expected: np.ndarray | None = None, *, told: bool = False
    ) -> Tracks:
        """Points in a smoothed grey image (h, w).

        `expected` (n, 2) tells about where the points of the last answer should be now; `told`
        that a gyro says so, and that it can be relied on.
        """
        if self._last is not None and len(self._tracks.pixel):
            guess = self._tracks.pixel if expected is None else expected
            levels = TOLD_LEVELS if told else BLIND_LEVELS
            self._tracks = self._followed(self._last, image, guess, levels)
        self._tracks = self._refilled(image)
        self._last = image
        return self._tracks

    def _followed(
        self, before: np.ndarray, image: np.ndarray, guess: np.ndarray, levels: int
    ) -> Tracks:
        tracks = self._tracks
        old = tracks.pixel.reshape(-1, 1, 2)
        new, found, _ = cv2.calcOpticalFlowPyrLK(
            before,
            image,
            old,
            guess.reshape(-1, 1, 2).astype(np.float32),  # a copy: it is written to
            flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
            winSize=WINDOW_PX,
            maxLevel=levels,
            criteria=STOP,
        )
        back, returned, _ = cv2.calcOpticalFlowPyrLK(
            image,
            before,
            new,
            old.copy(),
            flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
            winSize=BACK_WINDOW_PX,
            maxLevel=0,
            criteria=STOP,
        )
        pixel = new.reshape(-1, 2)
        good = (found.ravel() == 1) & (returned.ravel() == 1)
        good &= np.abs(back - old).reshape(-1, 2).max(axis=1) < BACK_PX
        limit = np.array([self._camera.width_px, self._camera.height_px]) - 1 - BORDER_PX
        good &= np.all((pixel > BORDER_PX) & (pixel < limit), axis=1)
        good[good] = _apart(pixel[good], image.shape)
        return Tracks(pixel[good], tracks.track_id[good], tracks.age[good] + 1)

    def _refilled(self, image: np.ndarray) -> Tracks:
        """Add corners where there is room: above the horizon and on the floor, in turns.

        Of two halves that lack corners only one is searched in a frame.
        """
        tracks = self._tracks
        horizon = int(self._camera.cy_px) + SPACING_PX
        upper = int(np.count_nonzero(tracks.pixel[:, 1] < horizon))
        wanted_up = round(self._config.max_tracks * UPPER_SHARE) - upper
        wanted_down = self._config.max_tracks - len(tracks.pixel) - max(wanted_up, 0)
        halves = [(slice(0, horizon), wanted_up), (slice(horizon, None), wanted_down)]
        self._upper_first = not self._upper_first
        lacking = [
            (half, wanted)
            for half, wanted in (halves if self._upper_first else halves[::-1])
            if wanted >= max(1, self._config.max_tracks // 12)
        ]
        if not lacking:
            return tracks
        half, wanted = lacking[0]
        room = np.zeros(image.shape, np.uint8)
        room[BORDER_PX:-BORDER_PX, BORDER_PX:-BORDER_PX] = 255
        start, stop, _ = half.indices(len(image))
        row = tracks.pixel[:, 1]
        near = tracks.pixel[(row > start - SPACING_PX - 1) & (row < stop + SPACING_PX)]
        for x, y in near.astype(int).tolist():
            cv2.circle(room, (x, y), SPACING_PX, 0, -1)
        new = self._corners(image[half], room[half], wanted) + np.array([0, half.start], np.float32)
        return Tracks(
            np.concatenate([tracks.pixel, new]),
            np.concatenate([tracks.track_id, self._ids.take(len(new))]),
            np.concatenate([tracks.age, np.zeros(len(new), np.int64)]),
        )

    def _corners(self, image: np.ndarray, room: np.ndarray, wanted: int) -> np.ndarray:
        """The strongest corners (n, 2) float32 above the noise, at least the spacing apart.

        `room` is 0 where no corner may be; the chosen ones take theirs.
        """
        strength = cv2.cornerMinEigenVal(image, BLOCK_PX, ksize=3)
        limit = max(CORNER_PER_NOISE2 * self._config.image_noise**2, 1e-6)
        peak = (
            (strength > limit)
            & (strength >= cv2.dilate(strength, np.ones((3, 3), np.uint8)))
            & (room > 0)
        )
        place = np.flatnonzero(peak)
        place = place[np.argsort(-strength.ravel()[place], kind="stable")]
        chosen: list[tuple[int, int]] = []
        for y, x in zip(*(part.tolist() for part in divmod(place, image.shape[1])), strict=True):
            if room[y, x]:
                chosen.append((x, y))
                cv2.circle(room, (x, y), SPACING_PX, 0, -1)
            if len(chosen) == wanted:
                break
        if not chosen:
            return np.empty((0, 2), np.float32)
        found = np.array(chosen, np.float32)[:, None]
        sharp = cv2.cornerSubPix(image, found.copy(), (3, 3), (-1, -1), CORNER_STOP)
        near = np.abs(sharp - found).max(axis=2, keepdims=True) < MAX_SHARPEN_PX
        return np.where(near, sharp, found).reshape(-1, 2)


class TrackIds:
    """Numbers for tracks of every kind."""

    def __init__(self) -> None:
        self._next = 0

    def take(self, count: int) -> np.ndarray:
        """The next `count` numbers (count,)."""
        first, self._next = self._next, self._next + count
        return np.arange(first, self._next, dtype=np.int64)


def turned(pixel: np.ndarray, yaw_rad: float, camera: StereoCamera) -> np.ndarray:
    """Where far points (n, 2) appear after the camera turned left by `yaw_rad`, float32."""
    angle = np.arctan((pixel[:, 0] - camera.cx_px) / camera.focal_px)
    new = np.clip(angle + yaw_rad, -1.3, 1.3)
    u = camera.cx_px + camera.focal_px * np.tan(new)
    v = camera.cy_px + (pixel[:, 1] - camera.cy_px) * np.cos(angle) / np.cos(new)
    return np.column_stack([u, v]).astype(np.float32)


def _apart(pixel: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Which points (n,) to keep so that none shares a cell of half the spacing with an older."""
    cell = SPACING_PX // 2
    index = (pixel[:, 1] // cell).astype(int) * shape[1] + (pixel[:, 0] // cell).astype(int)
    first = np.zeros(len(pixel), bool)
    first[np.unique(index, return_index=True)[1]] = True
    return first
