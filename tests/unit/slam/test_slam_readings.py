"""What waits to be seen again: in the same place, under the same name, soon enough."""

import numpy as np
import pytest

from robot.slam.survey.readings import Readings

COV = 0.05**2 * np.eye(2)
HERE = np.array([1.0, 2.0])


def test_seen_often_enough_it_waits_no_longer() -> None:
    readings = Readings(3, 10.0)
    assert [readings.add(HERE + 0.01 * k, COV, -1, 0.5 * k) for k in range(4)] == [
        False,
        False,
        True,
        False,  # the fourth begins anew
    ]


@pytest.mark.parametrize(
    ("place", "name", "t_s"),
    [(HERE + 0.5, 7, 1.0), (HERE, 8, 1.0), (HERE, 7, 0.0)],
    ids=["elsewhere", "another name", "the same frame"],
)
def test_another_sight_does_not_count(place: np.ndarray, name: int, t_s: float) -> None:
    readings = Readings(2, 10.0)
    assert not readings.add(HERE, COV, 7, 0.0)
    assert not readings.add(place, COV, name, t_s)
    assert readings.add(HERE, COV, 7, 2.0)


def test_what_is_not_seen_again_is_dropped() -> None:
    readings = Readings(2, 10.0)
    readings.add(HERE, COV, 7, 0.0)
    readings.expire(10.5)
    assert not readings.add(HERE, COV, 7, 11.0)


def test_one_sight_may_be_enough() -> None:
    assert Readings(1, 10.0).add(HERE, COV, -1, 0.0)
