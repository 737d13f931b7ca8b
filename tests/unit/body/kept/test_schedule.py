"""The schedule fires once, whatever the clock does."""

import json
from datetime import UTC, date, datetime, timedelta
from zoneinfo import ZoneInfo

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.body.kept.schedule import Schedule, due
from robot.errors import ConfigError, RequestError

BERLIN = ZoneInfo("Europe/Berlin")


def local(*parts):
    return datetime(*parts, tzinfo=BERLIN)


def at(text, days="daily"):
    return Schedule().add(days, text, ["start"])


def live(schedule, times):
    """All times at which an entry fired, looking at the clock at each of `times`."""
    fired = []
    for now in times:
        came = due(schedule, now)
        schedule = came.schedule
        fired += [now] * len(came.entries)
    return fired


def every(start, step_s, count):
    """Real time, shown by the wall clock of Berlin."""
    begin = start.astimezone(UTC)
    return [(begin + timedelta(seconds=step_s * k)).astimezone(BERLIN) for k in range(count)]


def test_an_entry_fires_once_a_day_at_its_time():
    fired = live(at("09:30"), every(local(2026, 3, 2, 0, 0), 600, 3 * 144))
    assert [(f.day, f.hour, f.minute) for f in fired] == [(2, 9, 30), (3, 9, 30), (4, 9, 30)]


def test_only_on_its_days():
    fired = live(at("09:30", "mon,Fri"), every(local(2026, 3, 2, 0, 0), 600, 14 * 144))
    assert [f.weekday() for f in fired] == [0, 4, 0, 4]


def test_the_hour_that_comes_twice_fires_once():
    fired = live(at("02:30"), every(local(2026, 10, 24, 22, 0), 5, 8 * 720))
    assert len(fired) == 1 and fired[0].hour == 2


def test_the_hour_that_never_comes_fires_after_the_change():
    fired = live(at("02:30"), every(local(2026, 3, 28, 22, 0), 5, 8 * 720))
    assert [(f.day, f.hour, f.minute) for f in fired] == [(29, 3, 0)]


def test_a_clock_without_a_battery_fires_nothing_of_the_past():
    times = [local(1970, 1, 1, 1, 0), local(1970, 1, 1, 1, 1), local(2026, 3, 2, 18, 0)]
    assert live(at("09:30"), times) == []


def test_what_was_missed_by_minutes_is_made_up_for():
    assert len(live(at("09:30"), [local(2026, 3, 2, 9, 0), local(2026, 3, 2, 9, 40)])) == 1
    assert live(at("09:30"), [local(2026, 3, 2, 9, 0), local(2026, 3, 2, 9, 50)]) == []


def test_a_clock_that_is_set_back_fires_nothing_again():
    times = every(local(2026, 3, 2, 9, 25), 60, 10) + every(local(2026, 3, 2, 9, 20), 60, 30)
    assert len(live(at("09:30"), times)) == 1


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.integers(-7200, 7200), max_size=6),
    st.integers(0, 23),
    st.integers(0, 59),
)
def test_no_jumps_of_the_clock_make_it_fire_twice_a_day(jumps, hour, minute):
    now, times = local(2026, 3, 2, 0, 0), []
    for jump in [*jumps, 0]:
        times += every(now, 300, 100)
        now = times[-1] + timedelta(seconds=jump)
    days = [f.date() for f in live(at(f"{hour}:{minute:02d}"), times)]
    assert len(days) == len(set(days))


def test_midnight_belongs_to_the_new_day():
    fired = live(at("00:00", "tue"), every(local(2026, 3, 2, 23, 50), 60, 30))
    assert [f.date() for f in fired] == [date(2026, 3, 3)]


def test_it_is_saved_and_read_again():
    schedule = due(at("09:30", "mon,sun").add("daily", "7:05", ["clean", "rooms", "a b"]),
                   local(2026, 3, 2, 9, 0)).schedule  # fmt: skip
    schedule = due(schedule, local(2026, 3, 2, 9, 31)).schedule
    again = Schedule.from_dict(json.loads(json.dumps(schedule.to_dict())))
    assert again == schedule and again.entries[0].fired == date(2026, 3, 2)
    assert str(again.entries[1]) == "daily 07:05 clean rooms a b"


@pytest.mark.parametrize("plain", [{}, {"entries": 3}, {"entries": [{}]}, {"entries": [
    {"days": ["x"], "at": "1:00", "words": ["start"]}]}])  # fmt: skip
def test_a_damaged_file_is_refused_by_name(plain):
    with pytest.raises(ConfigError, match=r"schedule\.json"):
        Schedule.from_dict(plain)


@pytest.mark.parametrize(
    ("days", "time", "words"),
    [("someday", "9:30", []), ("mon", "25:00", []), ("mon", "9.30", []), ("mon", "9:3", []),
     ("mon", "9:30", ["manual", "1", "1"]), ("mon", "9:30", ["sing"])],
)  # fmt: skip
def test_what_makes_no_sense_is_refused(days, time, words):
    with pytest.raises(RequestError):
        Schedule().add(days, time, words)
