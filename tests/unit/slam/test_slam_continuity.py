"""A frame goes on from the last one, tells nothing of it, or shows another place."""

import math

import numpy as np
import pytest

from robot.geometry.se2 import SE2, exp
from robot.messages import Scan, Seen, VisualMotion
from robot.slam.continuity import BEARINGS, Continuity, agreement, hits

S = 1_000_000_000
BEARING_RAD = np.linspace(-0.6, 0.6, 60)


def walls(pose: SE2, ahead_m: float) -> Scan:
    """A room's corner: a wall at x = `ahead_m` and one at y = 0.8."""
    heading = pose.yaw_rad + BEARING_RAD
    with np.errstate(divide="ignore"):
        to_front, to_left = (
            (ahead_m - pose.x_m) / np.cos(heading),
            (0.8 - pose.y_m) / np.sin(heading),
        )
    range_m = np.minimum(to_front, np.where(to_left > 0.0, to_left, math.inf))
    return Scan(BEARING_RAD, range_m, range_m)


def frame(k: int, scan: Scan, inliers: int = 0, quality: float = 0.7) -> Seen:
    """Nothing followed: points there are, tracks there are none."""
    motion = VisualMotion(SE2(), np.eye(3), inliers) if inliers else None
    return Seen(
        t_ns=k * S // 10,
        seq=k,
        arrived_ns=k * S // 10,
        landmarks=(),
        scan=scan,
        quality=quality,
        motion=motion,
    )


def nothing() -> Scan:
    return Scan(BEARING_RAD, np.full(60, math.nan), np.full(60, math.nan))


@pytest.mark.parametrize("step", [exp(0.03, 0.0, 0.0), exp(0.0, 0.0, 0.15), exp(0.02, 0.0, -0.1)])
def test_walls_stay_where_they_are_however_the_robot_moves(step: SE2) -> None:
    pose, rng = SE2(), np.random.default_rng(1)
    before = walls(pose, 1.5)
    for _ in range(10):
        after = walls(pose @ step, 1.5)
        noisy = after.range_m + rng.normal(0.0, 0.02, 60) * after.range_m**2
        seen = Scan(BEARING_RAD, noisy, noisy)
        common, same = agreement(step.inverse().apply(hits(before)), hits(seen))
        assert common >= 30 and same > 0.9 * common
        pose, before = pose @ step, seen


@pytest.mark.parametrize(
    ("inliers", "quality", "late", "scan", "change"),
    [
        (30, 0.6, 0, walls(SE2(), 0.7), "carried"),
        (30, 0.6, 0, walls(SE2(), 1.5), "broken"),  # the walls stand where they stood
        (30, 0.6, 0, nothing(), "broken"),  # and here none is seen
        (30, 0.6, 9, walls(SE2(), 0.7), "broken"),  # much later
        (0, 0.6, 0, walls(SE2(), 0.7), "broken"),  # nothing could be followed, nothing was lost
        (0, 0.2, 0, walls(SE2(), 0.7), "carried"),  # but the picture is quite another one
        (30, 0.05, 0, walls(SE2(), 0.7), "broken"),  # or hardly a picture at all
    ],
)
def test_walls_that_stand_elsewhere_at_once_tell_of_a_carry(
    inliers: int, quality: float, late: int, scan: Scan, change: str
) -> None:
    eyes = Continuity()
    assert eyes.follow(frame(0, walls(SE2(), 1.5), inliers)) in ("none", "broken")
    assert eyes.follow(frame(1 + late, scan, quality=quality)) == change


def test_what_it_drove_in_between_is_no_carry() -> None:
    for driven, change in ((True, "broken"), (False, "carried")):
        eyes = Continuity()
        eyes.follow(frame(0, walls(SE2(), 1.5), 30))
        if driven:
            eyes.moved(SE2(0.6))
        assert eyes.follow(frame(1, walls(SE2(0.6), 1.5))) == change


def test_few_bearings_prove_nothing() -> None:
    for known, change in ((BEARINGS - 1, "broken"), (BEARINGS, "carried")):
        eyes, scan = Continuity(), walls(SE2(), 0.7)
        eyes.follow(frame(0, walls(SE2(), 1.5), 30))
        range_m = np.where(np.arange(60) < known, scan.range_m, math.nan)
        assert eyes.follow(frame(1, Scan(BEARING_RAD, range_m, range_m))) == change
