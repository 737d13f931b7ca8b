"""Wheel scale and track width from a straight drive along a tape and from turns on the spot.

The gyro is the judge of turning, the tape of distance (after Borenstein and Feng, "Measurement
and correction of systematic odometry errors in mobile robots", 1996, whose square a gyro makes
needless).
"""

from __future__ import annotations

from dataclasses import dataclass

from robot.errors import CalibrationError

MIN_STRAIGHT_M, MIN_TURN_RAD = 0.5, 6.0
_MAX_CHANGE = 0.25  # relative to what was configured: more is a wrong wheel or a slip
_MAX_IMBALANCE = 0.05


@dataclass(frozen=True, slots=True)
class Straight:
    """A straight drive: ticks of both wheels, what the tape says, what the gyro says."""

    left_ticks: int
    right_ticks: int
    measured_m: float
    turned_rad: float


@dataclass(frozen=True, slots=True)
class Turn:
    """Turns on the spot, to the left: ticks of both wheels and the gyro's angle."""

    left_ticks: int
    right_ticks: int
    turned_rad: float


@dataclass(frozen=True, slots=True)
class WheelResult:
    """What belongs into the configuration, and how unequal the wheels are."""

    metres_per_tick: float
    track_width_m: float
    imbalance: float  # (right - left) / mean of the wheels' scales


def calibrate_wheels(
    straight: Straight, turn: Turn, metres_per_tick: float, track_width_m: float
) -> WheelResult:
    """Raises CalibrationError for drives that are too short, or values far from the configured."""
    ticks = (straight.left_ticks + straight.right_ticks) / 2.0
    if straight.measured_m < MIN_STRAIGHT_M or ticks <= 0:
        raise CalibrationError(
            f"the straight drive measured {straight.measured_m:.2f} m; drive at least "
            f"{MIN_STRAIGHT_M:g} m forward, and check that both encoders count up."
        )
    if turn.turned_rad < MIN_TURN_RAD:
        raise CalibrationError(
            f"the robot turned by {turn.turned_rad:.2f} rad; turn at least {MIN_TURN_RAD:g} rad to "
            "the left, and check the gyro's sign (sensors.imu_axis)."
        )
    scale = straight.measured_m / ticks
    width = (turn.right_ticks - turn.left_ticks) * scale / turn.turned_rad
    # With scales s (1 -+ e/2): right - left = s (r - l) + s e t, which is width * turned.
    excess_m = width * straight.turned_rad - scale * (straight.right_ticks - straight.left_ticks)
    imbalance = excess_m / straight.measured_m
    for name, found, configured in (
        ("link.metres_per_tick", scale, metres_per_tick),
        ("robot.track_width_m", width, track_width_m),
    ):
        if abs(found / configured - 1.0) > _MAX_CHANGE:
            raise CalibrationError(
                f"{name} would be {found:.4g} where {configured:.4g} is configured; a wheel "
                "slipped or the distance is wrong: repeat it on firm floor."
            )
    if abs(imbalance) > _MAX_IMBALANCE:
        raise CalibrationError(
            f"the wheels differ by {100 * imbalance:.1f} %; check tyres and encoders, then repeat."
        )
    return WheelResult(scale, width, imbalance)
