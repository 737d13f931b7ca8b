"""Two touches with one side tell how the wall lies that was touched."""

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from robot.geometry.se2 import SE2, wrap_angle
from robot.messages import Contact
from robot.mission.touch import CHORD_M, SIDES_RAD, Touch, touch, wall_since

INSIDE_RAD = 0.01


def at_wall(along_m, yaw_rad, side):
    """A robot with this yaw that touches a wall along x, which lies on its left (1) or right."""
    return Touch(SE2(along_m, 0.0, yaw_rad), side)


@given(
    st.sampled_from([1.0, -1.0]),
    st.floats(INSIDE_RAD, 1.8 - INSIDE_RAD),
    st.floats(INSIDE_RAD, 1.8 - INSIDE_RAD),
    st.floats(-0.5, 0.5),
    st.floats(-math.pi, math.pi),
)
def test_a_wall_is_found_however_it_was_touched(side, bearing_rad, before_rad, chord_m, turned_rad):
    assume(CHORD_M[0] < abs(chord_m) < CHORD_M[1])
    turned = SE2(yaw_rad=turned_rad)
    inward_rad = math.pi / 2.0
    touches = []
    for along_m, rad in ((0.0, before_rad), (chord_m, bearing_rad)):
        here = at_wall(along_m, inward_rad - side * rad, side)
        touches.append(Touch(turned @ here.place, side))
    found = wall_since(touches[1], touches[:1])
    assert found is not None and found[0] is touches[0]
    assert wrap_angle(found[1] - side * bearing_rad) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    "before",
    [
        at_wall(-0.1, 0.0, -1.0),  # the other side
        at_wall(-0.1, 0.0, 0.0),  # the front
        at_wall(-0.01, 0.0, 1.0),  # too near to tell
        at_wall(-0.5, 0.0, 1.0),  # too far to be the same
        at_wall(-0.1, math.pi, 1.0),  # the wall would have stood on its right
    ],
)
def test_no_wall_is_made_of_touches_that_tell_none(before):
    last = at_wall(0.0, 0.0, 1.0)
    assert wall_since(last, [before]) is None
    good = at_wall(-0.1, 0.0, 1.0)
    assert wall_since(last, [before, good]) == (good, pytest.approx(math.pi / 2.0))
    assert wall_since(Touch(last.place, 0.0), [good]) is None


def test_the_switches_tell_the_side():
    for left, right, side in ((True, False, 1.0), (False, True, -1.0), (True, True, 0.0)):
        here = touch(Contact(0, bump_left=left, bump_right=right), SE2(1.0))
        assert here == Touch(SE2(1.0), side) and side in SIDES_RAD
