"""Long vertical edges of one image, as fitted lines: door frames, furniture, wall corners.

Extrema of the horizontal gradient are linked down the rows (connected components of equal sign)
and a line u = u_0 + slope (v - v_0) is fitted to their sub-pixel places. All of it happens at half
the vertical resolution: nothing is lost along a long edge, and half the time is saved.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

HALVE = 2  # two rows become their mean
MIN_ROWS = 24  # of the full image
MIN_FILLED = 0.7
MAX_SLOPE = 0.035
MAX_RMS_PX = 0.6
MAX_BOX_PX = 6
MIN_GRADIENT = 1.5  # times the noise, grey levels per pixel
SAMPLES = 24  # rows looked at when a line is placed in an image
REACH_PX = 3.0
STEP_PX = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Lines:
    """Edges (n,) of one image: column at row `v`, slope, first and last row, sign, strength."""

    u: np.ndarray
    v: np.ndarray
    slope: np.ndarray
    top: np.ndarray
    bottom: np.ndarray
    sign: np.ndarray
    strength: np.ndarray

    def at(self, v: float) -> np.ndarray:
        """Column (n,) of every line at row `v`."""
        return self.u + self.slope * (v - self.v)

    def __getitem__(self, index: np.ndarray) -> Lines:
        return Lines(*(getattr(self, name)[index] for name in self.__slots__))


def slopes_of(image: np.ndarray) -> np.ndarray:
    """Horizontal gradient in grey levels per pixel, float32 (h / 2, w), of a smoothed image."""
    height = len(image)
    even, odd = image[: height - height % 2 : 2], image[1::2]
    low = cv2.addWeighted(even, 0.5, odd, 0.5, 0.0)
    return cv2.Sobel(low, cv2.CV_32F, 1, 0, ksize=3, scale=0.125)


def find_lines(gradient: np.ndarray, noise: float) -> Lines:
    """All vertical edges in the gradient (h / 2, w) of an image."""
    strength = np.abs(gradient)
    centre = strength[:, 1:-1]
    peak = (centre > max(MIN_GRADIENT * noise, 1.0)) & (centre >= strength[:, :-2])
    peak &= centre > strength[:, 2:]
    rising = gradient[:, 1:-1] > 0
    # Both signs in one image, one above the other, so that they are labelled together.
    both = np.vstack([peak & rising, peak & ~rising]).view(np.uint8)
    _, label, box, _ = cv2.connectedComponentsWithStats(both, connectivity=8)
    rows = box[:, cv2.CC_STAT_HEIGHT]
    long = (rows * HALVE >= MIN_ROWS) & (box[:, cv2.CC_STAT_WIDTH] <= MAX_BOX_PX)
    long &= box[:, cv2.CC_STAT_AREA] >= MIN_FILLED * rows
    long[0] = False  # the background
    return _fit(strength, label, box, long)


def _fit(strength: np.ndarray, label: np.ndarray, box: np.ndarray, long: np.ndarray) -> Lines:
    """Straight lines through the sub-pixel peaks of the long components."""
    height = strength.shape[0]
    members = []
    for number in np.flatnonzero(long).tolist():
        left, top, wide, tall, _ = box[number].tolist()
        row, column = np.nonzero(label[top : top + tall, left : left + wide] == number)
        members.append((row + top, column + left + 1))  # from its first row to its last
    count = len(members)
    which = np.repeat(np.arange(count), [len(row) for row, _ in members])
    row, column = (
        np.concatenate([m[k] for m in members]) if members else np.empty(0, int) for k in (0, 1)
    )
    sign = np.array([1 if m[0][0] < height else -1 for m in members], int)
    v = row % height
    before, middle, after = (strength[v, column + k].astype(np.float64) for k in (-1, 0, 1))
    bend = np.minimum(before - 2.0 * middle + after, -1e-9)
    u = column + 0.5 * (before - after) / bend
    v = HALVE * v + 0.5 * (HALVE - 1)  # the middle of the rows that were averaged

    def mean(values: np.ndarray) -> np.ndarray:
        total = np.bincount(which, weights=values, minlength=count)
        return total / np.maximum(np.bincount(which, minlength=count), 1)

    mean_v, mean_u = mean(v), mean(u)
    dv, du = v - mean_v[which], u - mean_u[which]
    slope = mean(dv * du) / np.maximum(mean(dv * dv), 1e-9)
    rms = np.sqrt(mean((du - slope[which] * dv) ** 2))
    top = np.array([HALVE * (m[0][0] % height) for m in members], int)
    bottom = np.array([HALVE * (m[0][-1] % height) + HALVE - 1 for m in members], int)
    good = (np.abs(slope) < MAX_SLOPE) & (rms < MAX_RMS_PX)
    return Lines(mean_u, mean_v, slope, top, bottom, sign, mean(middle))[good]


def place_lines(
    gradient: np.ndarray, lines: Lines, shift_px: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Where lines, moved left by about `shift_px` (n,), are in another image's gradient.

    Returns how far they lie right of the moved place (n,) in pixels, NaN if not within reach, and
    the strength (n,) found. The gradient along each line is summed before its peak is taken.
    """
    steps = np.arange(-REACH_PX, REACH_PX + 1e-9, STEP_PX)
    share = (np.arange(SAMPLES) + 0.5) / SAMPLES
    v = lines.top[:, None] + share[None] * (lines.bottom - lines.top)[:, None]
    u = lines.u[:, None] + lines.slope[:, None] * (v - lines.v[:, None]) - shift_px[:, None]
    map_u = (u[:, :, None] + steps).reshape(-1, len(steps)).astype(np.float32)
    low_v = (v + 0.5) / HALVE - 0.5
    map_v = np.broadcast_to(low_v[:, :, None], (*v.shape, len(steps)))
    map_v = map_v.reshape(-1, len(steps)).astype(np.float32)
    if not len(map_u):
        return np.empty(0), np.empty(0)
    seen = cv2.remap(gradient, map_u, map_v, cv2.INTER_CUBIC).reshape(len(u), SAMPLES, -1)
    profile = seen.mean(axis=1) * lines.sign[:, None]
    best = np.argmax(profile, axis=1)
    each = np.arange(len(best))
    inner = (best > 0) & (best < len(steps) - 1)
    at = np.clip(best, 1, len(steps) - 2)
    before, middle, after = (profile[each, at + k] for k in (-1, 0, 1))
    bend = np.minimum(before - 2.0 * middle + after, -1e-9)
    place = steps[at] + STEP_PX * 0.5 * (before - after) / bend
    return np.where(inner, place, np.nan), middle
