"""Sub-pixel disparity of single points, better than any dense matcher gives it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from robot.perception.tracks import Tracks

AGREE_PX = 0.6  # with the dense matcher ...
AGREE_SHARE = 0.04  # ... or so much of the disparity
ROW_PX = 0.8  # how far off its row a match may be: eyes are never quite level
EDGE_PX = 1.0  # disparity changing more than that around a point: a depth edge
EDGE_SHARE = 0.06
REACH_PX = 3  # half the neighbourhood looked at
FLOOR_PX = 0.7  # the dense disparity of floor is so near to the plane's ...
FLOOR_SHARE = 0.04  # ... or so much of it
MIN_FLOOR_PX = 5.0  # farther away floor and what stands on it look the same
WINDOW_PX = (16, 13)  # a multiple of four wide, see tracks
STOP = (3, 10, 0.02)  # by count and by epsilon


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """Tracked points with stereo: pixel (n, 2), disparity_px (n,) NaN where it is not known.

    `steady` (n,) tells the points that do not sit on a depth edge, where background slides
    behind foreground and neither place nor look stays the same.
    """

    pixel: np.ndarray
    disparity_px: np.ndarray
    steady: np.ndarray
    track_id: np.ndarray
    age: np.ndarray


def measure(
    left: np.ndarray,
    right: np.ndarray,
    dense_px: np.ndarray,
    tracks: Tracks,
    floor_px: np.ndarray,
) -> Points:
    """Match every track in the right image, starting from the dense disparity (h, w).

    Both images are smoothed and of equal exposure. A point without dense disparity around it, or
    whose match disagrees with it, has NaN. Where the dense disparity agrees with `floor_px` (n,),
    the floor's disparity at the tracks, that is taken: a small window slides along the joints and
    grain of a floor, while the plane is known from thousands of pixels.
    """
    count = len(tracks.pixel)
    if count == 0:
        empty = np.empty(0)
        return Points(tracks.pixel, empty, empty.astype(bool), tracks.track_id, tracks.age)
    low, middle, high = _around(dense_px, tracks.pixel)
    known = np.isfinite(middle)
    spread = high - low
    edge = ~known | (spread > EDGE_PX + EDGE_SHARE * np.nan_to_num(middle))
    seed = np.where(known, np.where(edge, high, middle), 0.0)  # corners belong to the near side
    start = tracks.pixel - np.column_stack([seed, np.zeros(count)]).astype(np.float32)
    matched, found, _ = cv2.calcOpticalFlowPyrLK(
        left,
        right,
        tracks.pixel.reshape(-1, 1, 2),
        start.reshape(-1, 1, 2),
        winSize=WINDOW_PX,
        maxLevel=0,
        criteria=STOP,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    offset = tracks.pixel - matched.reshape(-1, 2)
    disparity = offset[:, 0].astype(np.float64)
    good = known & (found.ravel() == 1) & (disparity > 0.3) & (np.abs(offset[:, 1]) < ROW_PX)
    good &= np.abs(disparity - seed) < AGREE_PX + AGREE_SHARE * seed
    with np.errstate(invalid="ignore"):
        flat = known & (np.abs(middle - floor_px) < FLOOR_PX + FLOOR_SHARE * floor_px)
        flat &= floor_px > MIN_FLOOR_PX
    disparity = np.where(flat, floor_px, np.where(good, disparity, np.nan))
    return Points(tracks.pixel, disparity, ~edge | flat, tracks.track_id, tracks.age)


def _around(dense: np.ndarray, pixel: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Least, median and greatest known disparity (n,) in each point's neighbourhood, NaN if none.

    A quarter of the neighbourhood must be known.
    """
    height, width = dense.shape
    column = np.clip(np.rint(pixel[:, 0]).astype(int), REACH_PX, width - 1 - REACH_PX)
    row = np.clip(np.rint(pixel[:, 1]).astype(int), REACH_PX, height - 1 - REACH_PX)
    step = np.array([-REACH_PX, -1, 1, REACH_PX])
    rows = row[:, None, None] + step[None, :, None]
    columns = column[:, None, None] + step[None, None, :]
    patch = np.sort(dense[rows, columns].reshape(len(pixel), -1), axis=1)  # NaN goes last
    known = np.count_nonzero(np.isfinite(patch), axis=1)
    each = np.arange(len(pixel))
    enough = known >= step.size**2 // 4
    last = np.maximum(known - 1, 0)
    values = (patch[:, 0], patch[each, last // 2], patch[each, last])
    low, middle, high = (np.where(enough, value, np.nan).astype(np.float64) for value in values)
    return low, middle, high
