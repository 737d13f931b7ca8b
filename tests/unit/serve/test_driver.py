"""The dead man's handle: whatever goes wrong between hand and robot, the robot is told to stop."""

import json
import time

import pytest
from serving import wait_for
from websockets.sync.client import connect

from robot.errors import RequestError
from robot.serve.driver import HOLD_S, read_wish


@pytest.fixture
def line(house):
    """(the live line, the stand-in)."""
    server, robot, _ = house
    robot.by_hand.clear()
    key = {"Authorization": f"Bearer {server.token}"}
    with connect(f"ws://127.0.0.1:{server.port}/api/v1/live", additional_headers=key) as line:
        yield line, robot
    robot.state = "docked"


def say(line, number, seen, drive):
    line.send(json.dumps({"drive": drive, "n": number, "seen": seen}))


def answer(line):
    """The next answer to a wish."""
    while True:
        words = line.recv(timeout=10)
        news = json.loads(words) if isinstance(words, str) else {}
        if news.get("type") == "drove":
            return news


def hold(line, times=4, drive=(0.1, 0.0)):
    """As a page does while a button is held."""
    for number in range(1, times + 1):
        say(line, number, number - 1, list(drive))
        assert answer(line) == {"type": "drove", "n": number, "refused": ""}
        time.sleep(0.05)


def stands(robot):
    return bool(robot.by_hand) and robot.by_hand[-1][1:] == (0.0, 0.0)


def test_it_drives_while_held_and_stops_when_let_go(line):
    line, robot = line
    hold(line)
    wait_for(lambda: any(order[1:] == (0.1, 0.0) for order in robot.by_hand))
    say(line, 5, 4, None)
    wait_for(lambda: stands(robot))


def test_it_stops_when_the_page_says_nothing_more(line):
    line, robot = line
    hold(line, 2)
    wait_for(lambda: stands(robot))


def test_it_stops_when_the_line_ends(house):
    server, robot, _ = house
    robot.by_hand.clear()
    key = {"Authorization": f"Bearer {server.token}"}
    with connect(f"ws://127.0.0.1:{server.port}/api/v1/live", additional_headers=key) as gone:
        hold(gone, 2)
        gone.socket.close()  # without a goodbye
    wait_for(lambda: stands(robot))
    robot.state = "docked"


def test_a_line_that_lags_does_not_drive(line):
    line, robot = line
    say(line, 20, 2, [0.1, 0.0])
    assert "lags" in answer(line)["refused"]
    time.sleep(HOLD_S)
    assert robot.by_hand == []


def test_one_hand_at_a_time(house, line):
    line, robot = line
    server = house[0]
    key = {"Authorization": f"Bearer {server.token}"}
    hold(line, 1)
    with connect(f"ws://127.0.0.1:{server.port}/api/v1/live", additional_headers=key) as other:
        say(line, 2, 1, [0.1, 0.0])
        answer(line)
        say(other, 1, 0, [-0.1, 0.0])
        assert "somebody else" in answer(other)["refused"]
    wait_for(lambda: stands(robot))
    assert not any(order[1] < 0 for order in robot.by_hand)


def test_a_refusal_of_the_robot_reaches_the_page(line):
    line, robot = line

    def refuse(args):
        raise RequestError("it is at work; ask stop first")

    robot.control.books = {**robot.control.books, "manual": refuse}
    try:
        refused, number = "", 0
        end = time.monotonic() + 10
        while not refused and time.monotonic() < end:
            number += 1
            say(line, number, number - 1, [0.1, 0.0])
            refused = answer(line)["refused"]
            time.sleep(0.1)
    finally:
        robot.control.books = robot.books.verbs
    assert "at work" in refused and robot.by_hand == []


def test_nonsense_is_no_wish():
    good = ([0, 0], [1, -6], [-0.5, 3.25])
    bad = (None, 1, [], [1], [1, 2, 3], ["1", 2], [True, 0], [2, 0], [0, 7], [float("nan"), 0], {})
    assert all(read_wish(wish) == tuple(map(float, wish)) for wish in good)
    assert all(read_wish(wish) is None for wish in bad)
