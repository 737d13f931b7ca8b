"""When the home is brought to the card: often while it changes, rarely while the robot rests."""

import dataclasses

import pytest

from robot.body.kept.keeper import EVERY_NS, RESTING_EVERY_NS, HomeKeeper
from robot.brain import Brain
from robot.config import Config
from robot.messages import MissionState

SECOND_NS = 1_000_000_000


class Log:
    def event(self, event): ...

    def command(self, command): ...

    def flush(self): ...


class Robot:
    def __init__(self):
        self.known = Brain(Config()).home()

    def home(self):
        return self.known


class Store:
    def __init__(self):
        self.saved = []

    def save(self, home):
        self.saved.append(home)


@pytest.fixture
def kept():
    robot, store = Robot(), Store()
    keeper = HomeKeeper(Log(), robot, store)
    yield robot, store, keeper
    keeper.close()


def state(t_ns, name):
    return MissionState(t_ns, name, "", 0.0, 0.0)


def spend(keeper, name, first_ns, last_ns):
    """A state a second, each saving finished before the next second."""
    for t_ns in range(first_ns, last_ns, SECOND_NS):
        keeper.command(state(t_ns, name))
        if keeper._writing is not None:
            keeper._writing.result()


def test_a_cleaning_robot_saves_every_five_minutes_and_when_it_rests(kept):
    _, store, keeper = kept
    spend(keeper, "clean", 0, 2 * EVERY_NS + SECOND_NS)
    assert len(store.saved) == 2
    spend(keeper, "charge", 3 * EVERY_NS, 3 * EVERY_NS + SECOND_NS)
    assert len(store.saved) == 3


def test_a_docked_robot_saves_once_an_hour(kept):
    _, store, keeper = kept
    spend(keeper, "clean", 0, SECOND_NS)
    spend(keeper, "charge", SECOND_NS, RESTING_EVERY_NS)
    assert len(store.saved) == 1  # when it came to rest
    spend(keeper, "charge", RESTING_EVERY_NS, 2 * RESTING_EVERY_NS)
    assert len(store.saved) == 2


def test_what_people_draw_while_it_rests_is_kept_within_minutes(kept):
    robot, store, keeper = kept
    spend(keeper, "clean", 0, SECOND_NS)
    spend(keeper, "charge", SECOND_NS, 2 * EVERY_NS)
    robot.known = dataclasses.replace(robot.known, settings={"fan": "low"})
    spend(keeper, "charge", 2 * EVERY_NS, 3 * EVERY_NS + 2 * SECOND_NS)
    assert [home.settings for home in store.saved][-1] == {"fan": "low"}
    assert len(store.saved) == 2
