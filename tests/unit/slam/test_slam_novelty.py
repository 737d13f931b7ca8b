"""Something new is the rival of every landmark."""

import math

import numpy as np
import pytest

from robot.slam.survey.novelty import novelty_cost

NOBODY = np.zeros(0)


@pytest.mark.parametrize(("spread_m2", "believed"), [(3.9, True), (4.1, False)])
def test_a_landmark_spread_over_the_floor_of_a_new_thing_is_not_believed(
    spread_m2: float, believed: bool
) -> None:
    """Half of what comes is new, one a disc of 2 m: 1 / 8 pi a square metre."""
    range_m = 2.0
    in_sights = spread_m2 / range_m**3  # square root of the determinant
    cost = novelty_cost(np.array([range_m]), NOBODY, new=0, again=0)
    assert (2.0 * math.log(in_sights) < cost) is believed


def test_it_costs_more_where_little_stands_and_little_was_new() -> None:
    range_m, near, far = np.array([3.0]), np.array([1.0, 2.0]), np.array([4.0, 5.0])
    assert novelty_cost(range_m, far, 2, 2) == novelty_cost(range_m, NOBODY, 2, 2)
    assert novelty_cost(range_m, near, 2, 2) < novelty_cost(range_m, far, 2, 2)
    assert novelty_cost(range_m, near, 2, 50) > novelty_cost(range_m, near, 2, 2)


def test_two_new_things_cost_as_much_as_each() -> None:
    one, other = np.array([2.0]), np.array([5.0])
    both = novelty_cost(np.array([2.0, 5.0]), NOBODY, 3, 9)
    assert both == pytest.approx(
        novelty_cost(one, NOBODY, 3, 9) + novelty_cost(other, NOBODY, 3, 9)
    )
