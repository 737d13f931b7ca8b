"""A place is known when what is seen stands where the map has it."""

import math

import numpy as np
import pytest

from robot.geometry.se2 import SE2
from robot.messages import Grid, Scan
from robot.mission.recognise import Recognition

RES = 0.05
BEARINGS = np.linspace(-0.6, 0.6, 61)


def corner():
    """Free floor of 4 m by 4 m around the origin, walls at x = 1 and y = -0.8."""
    cells = np.zeros((80, 80), np.int8)
    cells[:, 60] = 100
    cells[24, :] = 100
    return Grid(RES, -2.0, -2.0, cells)


def look(pose):
    """Ranges to the two walls from a pose inside of them."""
    angle = pose.yaw_rad + BEARINGS
    with np.errstate(divide="ignore"):
        to_x = np.where(np.cos(angle) > 0, (1.025 - pose.x_m) / np.cos(angle), np.inf)
        to_y = np.where(np.sin(angle) < 0, (-0.775 - pose.y_m) / np.sin(angle), np.inf)
    range_m = np.minimum(to_x, to_y)
    return Scan(BEARINGS, np.where(range_m < 3.0, range_m, np.nan), np.minimum(range_m, 3.0))


def shown(true, believed, frames=5):
    recognition = Recognition()
    for _ in range(frames):
        recognition.see(corner(), believed, look(true))
    return recognition.share


def test_the_right_place_is_known():
    assert shown(SE2(0.2, 0.1, -0.4), SE2(0.2, 0.1, -0.4)) > 0.95


@pytest.mark.parametrize("believed", [SE2(-0.4, 0.1, -0.4), SE2(0.2, 0.1, 1.5), SE2(50.0, 0, 0)])
def test_a_wrong_place_is_not(believed):
    assert shown(SE2(0.2, 0.1, -0.4), believed) < 0.4


def test_too_little_seen_is_unknown_and_forgetting_begins_anew():
    assert math.isnan(shown(SE2(0.2, 0.1, math.pi - 0.8), SE2(), frames=1))
    recognition = Recognition()
    for _ in range(5):
        recognition.see(corner(), SE2(), look(SE2()))
    recognition.forget()
    assert math.isnan(recognition.share)


def test_what_was_seen_long_ago_fades():
    recognition = Recognition()
    for _ in range(20):
        recognition.see(corner(), SE2(), look(SE2()))
    for _ in range(12):
        recognition.see(corner(), SE2(-0.6, 0.3, 0.5), look(SE2()))
    assert recognition.share < 0.3


def test_the_whole_share_forgets_nothing():
    recognition = Recognition()
    for _ in range(20):
        recognition.see(corner(), SE2(-0.6, 0.3, 0.5), look(SE2()))
    for _ in range(20):
        recognition.see(corner(), SE2(), look(SE2()))
    assert recognition.share > 0.9 and 0.4 < recognition.whole_share < 0.7
    recognition.forget()
    assert math.isnan(recognition.whole_share)


@pytest.mark.parametrize(
    ("off", "fits"), [(SE2(), True), (SE2(-0.5, 0.2, 0.0), False), (SE2(0, 0, 0.5), False)]
)
def test_what_was_seen_lately_tells_whether_a_pose_fits(off, fits):
    recognition, true = Recognition(), SE2(0.2, 0.1, -0.4)
    for k in range(5):
        recognition.look(
            k * 100_000_000, SE2(0.0, 0.0, 0.1 * k), look(true @ SE2(0.0, 0.0, 0.1 * k))
        )
    share = recognition.share_at(corner(), off @ true)
    assert share > 0.95 if fits else share < 0.5


def test_what_was_seen_long_ago_tells_no_pose():
    recognition = Recognition()
    recognition.look(0, SE2(), look(SE2()))
    assert recognition.share_at(corner(), SE2()) > 0.95
    nothing = Scan(BEARINGS, np.full(61, np.nan), np.full(61, np.nan))
    recognition.look(5_000_000_000, SE2(), nothing)
    assert math.isnan(recognition.share_at(corner(), SE2()))
