"""Are both eyes really exposed at once? A blinking light tells, a driver's time stamp does not.

Each picture shows the light on or off. If the right eye is exposed `offset` later than the left,
the light has changed in between in a share offset / (period / 2) of the pairs, as long as frames
and blinking keep no common beat. So that share, times half the period, is the offset.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robot.errors import CalibrationError

MIN_PAIRS = 100
MAX_OFFSET_MS = 2.0  # a robot that turns at 1 rad/s smears half a pixel in that time
_MIN_CONTRAST = 25.0  # grey levels between on and off
_PATCH_PX = 5


@dataclass(frozen=True, slots=True)
class SyncResult:
    """Time between the two exposures, and its standard error, in milliseconds."""

    offset_ms: float
    sigma_ms: float
    pairs: int

    @property
    def synchronised(self) -> bool:
        """Good enough to match moving pictures."""
        return self.offset_ms - self.sigma_ms <= MAX_OFFSET_MS


class LightWatch:
    """Finds the blinking light in a row of pictures of one eye: what changes most."""

    def __init__(self) -> None:
        self._pictures: list[np.ndarray] = []

    def add(self, picture: np.ndarray) -> None:
        """Remember a picture (h, w) uint8, made smaller."""
        height, width = (n - n % _PATCH_PX for n in picture.shape)
        small = picture[:height, :width].reshape(
            height // _PATCH_PX, _PATCH_PX, width // _PATCH_PX, _PATCH_PX
        )
        self._pictures.append(small.mean(axis=(1, 3)).astype(np.float32))

    def levels(self) -> np.ndarray:
        """Brightness (n,) of the place that changes most."""
        stack = np.stack(self._pictures)
        spread = np.percentile(stack, 90, axis=0) - np.percentile(stack, 10, axis=0)
        row, column = np.unravel_index(int(np.argmax(spread)), spread.shape)
        return stack[:, row, column]


def measure_sync(left: np.ndarray, right: np.ndarray, blink_hz: float) -> SyncResult:
    """From the light's brightness (n,) in both eyes. Raises CalibrationError when it cannot."""
    if len(left) < MIN_PAIRS:
        raise CalibrationError(
            f"{len(left)} pairs are too few where {MIN_PAIRS} are needed; watch for longer."
        )
    half_ms = 500.0 / blink_hz
    lit = []
    for side, levels in (("left", left), ("right", right)):
        low, high = np.percentile(levels, [10, 90])
        if high - low < _MIN_CONTRAST:
            raise CalibrationError(
                f"the {side} eye sees no blinking light ({high - low:.0f} grey levels of change); "
                "hold a blinking LED where both eyes see it, in a dim room."
            )
        lit.append(levels > (low + high) / 2.0)
    share_on = float(lit[0].mean())
    if not 0.2 < share_on < 0.8:
        raise CalibrationError(
            f"the light is on in {100 * share_on:.0f} % of the pictures: frames and blinking keep "
            "step; let it blink a little faster or slower."
        )
    differ = float((lit[0] != lit[1]).mean())
    sigma = float(np.sqrt(max(differ * (1.0 - differ), 0.25 / len(left)) / len(left)))
    return SyncResult(differ * half_ms, sigma * half_ms, len(left))
