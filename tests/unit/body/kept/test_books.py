"""The books beside the map: hours, runs and the schedule, through restarts and damage."""

import json
from datetime import datetime, timedelta
from zoneinfo import ZoneInfo

import pytest

from robot.body.kept.books import Books, WithSchedule
from robot.errors import ConfigError, RequestError
from robot.messages import DriveCommand, MissionState

NS = 1_000_000_000
START = datetime(2026, 3, 2, 9, 0, tzinfo=ZoneInfo("Europe/Berlin"))


class NoLog:
    def event(self, event):
        pass

    command = event

    def flush(self):
        pass


class Clock:
    def __init__(self):
        self.now = START

    def __call__(self):
        return self.now


def drive(t_ns, brush=0.0, fan=0.0):
    return DriveCommand(t_ns, 0.1, 0.0, brush, fan, 200, "")


def clean(books, start_s, end_s):
    """A run with brush and fan, then on the dock."""
    books.command(MissionState(start_s * NS, "clean", "start was requested", 0.0, 5.0))
    for k in range(start_s * 2, end_s * 2):
        books.command(drive(k * NS // 2, brush=0.8, fan=0.8))
    books.command(MissionState(end_s * NS - 1, "dock", "before the dock", 4.0, 0.0))
    books.command(MissionState(end_s * NS, "done", "docked and charging", 4.0, 0.0))


@pytest.fixture
def clock():
    return Clock()


def test_driving_by_hand_is_no_run(tmp_path, clock):
    books = Books(NoLog(), tmp_path, clock)
    books.command(MissionState(1 * NS, "manual", "driving by hand", 0.0, 5.0))
    books.command(MissionState(60 * NS, "idle", "nobody drives by hand any more", 0.0, 5.0))
    assert books.verbs()["history"](())["data"]["runs"] == []
    clean(books, 100, 200)
    assert len(books.verbs()["history"](())["data"]["runs"]) == 1


def test_hours_are_counted_while_parts_turn_and_live_through_a_restart(tmp_path, clock):
    books = Books(NoLog(), tmp_path, clock)
    for k in range(100):
        books.command(drive(k * NS))  # at rest: nothing wears
    clean(books, 100, 1900)
    books.close()
    again = Books(NoLog(), tmp_path, clock)
    answer = again.verbs()["consumables"](())
    hours = answer["data"]["hours"]
    assert hours["brush"] == hours["filter"] == pytest.approx(0.5, abs=0.01)
    assert hours["sensors"] == pytest.approx(0.5, abs=0.01)
    assert again.verbs()["consumables reset"](("Brush",))
    assert again.verbs()["consumables"](())["data"]["hours"]["brush"] == 0.0
    with pytest.raises(RequestError, match="filter"):
        again.verbs()["consumables reset"](("wheel",))
    again.close()


def test_a_worn_part_is_named(tmp_path, clock):
    (tmp_path / "consumables.json").write_text('{"sensors": 31.0}')
    books = Books(NoLog(), tmp_path, clock)
    assert books.verbs()["consumables"](())["reason"] == "see to: sensors"
    books.close()


def test_runs_are_remembered_newest_first_and_a_slip_of_the_finger_is_none(tmp_path, clock):
    books = Books(NoLog(), tmp_path, clock)
    clean(books, 10, 15)
    assert books.verbs()["history"](())["reason"] == "no run is known yet"
    clean(books, 100, 400)
    clock.now += timedelta(hours=1)
    clean(books, 500, 900)
    books.close()
    books = Books(NoLog(), tmp_path, clock)
    runs = books.verbs()["history"](("5",))["data"]["runs"]
    assert [run["duration_s"] for run in runs] == [400.0, 300.0]
    assert runs[0]["covered_m2"] == 4.0 and runs[0]["reason"] == "docked and charging"
    assert runs[0]["began"].startswith("2026-03-02T10:00")
    files = sorted((tmp_path / "runs").glob("*.json"))
    assert json.loads(files[-1].read_text()) == runs[0]
    books.close()


def test_the_schedule_asks_by_itself_and_once(tmp_path, clock):
    books = Books(NoLog(), tmp_path, clock)
    asked = WithSchedule(None, books)
    books.verbs()["schedule add"](("mon", "09:30", "clean", "rooms", "hall"))
    requests = []
    for k in range(60):
        clock.now = START + timedelta(minutes=k)
        requests += asked.poll(k * 60 * NS)
    assert [(r.verb, r.args) for r in requests] == [("clean", ("rooms", "hall"))]
    books.close()
    again = Books(NoLog(), tmp_path, clock)
    clock.now = START + timedelta(minutes=31)
    assert WithSchedule(None, again).poll(0) == []  # it has fired on this day
    lines = again.verbs()["schedule list"](())["data"]["lines"]
    assert lines == ["1: mon 09:30 clean rooms hall"]
    again.verbs()["schedule remove"](("1",))
    with pytest.raises(RequestError, match="no entry 1"):
        again.verbs()["schedule remove"](("1",))
    again.close()


@pytest.mark.parametrize(
    ("name", "text"),
    [("schedule.json", "{"), ("schedule.json", "[]"), ("history.json", "{}"),
     ("consumables.json", '{"brush": "new"}'), ("consumables.json", '{"brush": -1}')],
)  # fmt: skip
def test_a_damaged_book_is_named(tmp_path, clock, name, text):
    (tmp_path / name).write_text(text)
    with pytest.raises(ConfigError, match=name.replace(".", r"\.")):
        Books(NoLog(), tmp_path, clock)


def test_a_folder_that_cannot_be_written_stops_nothing(tmp_path, clock):
    (tmp_path / "runs").write_text("a file where a folder should be")
    books = Books(NoLog(), tmp_path, clock)
    clean(books, 0, 60)
    books.close()
    assert (tmp_path / "history.json").exists()
