"""Touches of the bumper, and the wall that two of them tell of.

The bumper tells the side, not the place. But a wall that touches two equal circles with the same
side runs parallel to the line between their centres.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from robot.geometry.se2 import SE2, wrap_angle
from robot.messages import Contact

SIDES_RAD = {1.0: (0.0, 1.8), -1.0: (-1.8, 0.0), 0.0: (-0.5, 0.5)}
CHORD_M = (0.03, 0.3)  # nearer touches tell no direction, farther ones may be of something else
LATELY = 6  # touches that are remembered


@dataclass(frozen=True, slots=True)
class Touch:
    """One touch: where, as `odom_from_base`, and with which side: left 1, right -1, both 0."""

    place: SE2
    side: float


def touch(contact: Contact, odom_from_base: SE2) -> Touch:
    """The touch that `contact` tells of."""
    return Touch(odom_from_base, float(contact.bump_left) - float(contact.bump_right))


def wall_since(last: Touch, earlier: Iterable[Touch]) -> tuple[Touch, float] | None:
    """The wall touched now and before: that touch, and the wall's bearing in `base` now.

    `earlier` holds the latest touch first.
    """
    if last.side == 0.0:
        return None
    for before in earlier:
        chord_m = last.place.distance_m(before.place)
        if before.side != last.side or not CHORD_M[0] <= chord_m <= CHORD_M[1]:
            continue
        x_m, y_m = last.place.x_m - before.place.x_m, last.place.y_m - before.place.y_m
        for across_rad in (math.pi / 2.0, -math.pi / 2.0):
            inward_rad = math.atan2(y_m, x_m) + across_rad
            if all(_on_side(t, inward_rad) for t in (last, before)):
                return before, wrap_angle(inward_rad - last.place.yaw_rad)
    return None


def _on_side(last: Touch, inward_rad: float) -> bool:
    low_rad, high_rad = SIDES_RAD[last.side]
    return low_rad <= wrap_angle(inward_rad - last.place.yaw_rad) <= high_rad
