"""What is known of a base and its sensor before the first sight."""

from __future__ import annotations

from dataclasses import dataclass

from robot.slam.survey.velocity import VelocityNoise


@dataclass(frozen=True, slots=True)
class SurveySettings:
    """What is known of a base and its sensor from their kind; nothing is fitted to a recording."""

    noise: VelocityNoise
    range_m: float  # constant part of a range's sigma
    inverse_range_per_m: float  # part that grows with the square of the range, as disparity's does
    bearing_rad: float
    curvature_sigma: float = 0.1  # rad/m
    speed_scale_sigma: float = 0.1
    turn_scale_sigma: float = 0.1
    lag_sigma_s: float = 0.2
    walk: tuple[float, float, float, float] = (0.002, 0.002, 0.002, 0.002)  # per sqrt(s)
    confirmations: int = 3  # sights of an unknown thing before it is a landmark
    confirm_within_s: float = 10.0
    ghost_sights: int = 5  # a landmark seen less often ...
    ghost_after_s: float = 20.0  # ... and not again for so long is dropped
    correlated_s: float = 1.0  # errors of the same sight last about so long
    new_beyond_chi2: float = 25.0  # a sight nearer than this to a landmark starts none
    margin: float = 4.0  # a second choice must cost this much more
    invariant: bool = True
    start_sigma: tuple[float, float, float] = (0.1, 0.1, 0.05)  # the map's frame is no better known
