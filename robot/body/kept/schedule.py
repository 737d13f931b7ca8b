"""When the robot cleans by itself: weekly entries, and what of them is due. Times are handed in.

An entry fires once a day at most, whatever the clock does: at the end of summer time its hour comes
twice, and at the beginning not at all. A clock that jumps far ahead (no battery, then network time)
fires only what was due within `GRACE` before now; one that jumps back fires nothing again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, date, datetime, time, timedelta
from typing import Any

from robot.errors import ConfigError, RequestError
from robot.mission.verbs import understand

DAYS = ("mon", "tue", "wed", "thu", "fri", "sat", "sun")
GRACE = timedelta(minutes=15)
AWAKE = timedelta(minutes=2)  # checked so lately, the robot has seen every minute pass
MAX_ENTRIES = 50


@dataclass(frozen=True, slots=True)
class Entry:
    """On these weekdays (0: Monday) at this time, local, a request."""

    days: frozenset[int]
    at: time
    words: tuple[str, ...] = ("start",)
    fired: date | None = None  # the local day on which it fired last

    def __str__(self) -> str:
        names = [DAYS[day] for day in sorted(self.days)]
        when = "daily" if len(names) == 7 else ",".join(names)
        return f"{when} {self.at:%H:%M} {' '.join(self.words)}"


@dataclass(frozen=True, slots=True)
class Schedule:
    """All entries of one map, and when they were last looked at."""

    entries: tuple[Entry, ...] = ()
    checked: datetime | None = None

    def add(self, days: str, at: str, words: Sequence[str]) -> Schedule:
        """With one more entry. Raises RequestError for what cannot be read."""
        if len(self.entries) >= MAX_ENTRIES:
            raise RequestError(f"there are {MAX_ENTRIES} entries already; remove some first.")
        verb, arguments = understand(list(words) or ["start"])
        if verb.place != "mission" or verb.name in ("manual", "pause", "resume", "stop"):
            raise RequestError(f"{verb.name} cannot be done by the clock; choose start or clean.")
        entry = Entry(read_days(days), read_time(at), (*verb.name.split(), *arguments))
        return replace(self, entries=(*self.entries, entry))

    def remove(self, number: int) -> Schedule:
        """Without entry 1, 2, ... Raises RequestError."""
        if not 1 <= number <= len(self.entries):
            raise RequestError(f"there is no entry {number}; see schedule list.")
        kept = self.entries[: number - 1] + self.entries[number:]
        return replace(self, entries=kept)

    def to_dict(self) -> dict[str, Any]:
        """As JSON holds it."""
        return {
            "checked": None if self.checked is None else self.checked.isoformat(),
            "entries": [
                {
                    "days": [DAYS[day] for day in sorted(entry.days)],
                    "at": f"{entry.at:%H:%M}",
                    "words": list(entry.words),
                    "fired": None if entry.fired is None else entry.fired.isoformat(),
                }
                for entry in self.entries
            ],
        }

    @classmethod
    def from_dict(cls, plain: Mapping[str, Any], name: str = "schedule.json") -> Schedule:
        """What `to_dict` gave. Raises ConfigError, naming `name`."""
        try:
            made = cls()
            for item in plain["entries"]:
                made = made.add(",".join(item["days"]), item["at"], item["words"])
                fired = item.get("fired")
                last = replace(made.entries[-1], fired=fired and date.fromisoformat(fired))
                made = replace(made, entries=(*made.entries[:-1], last))
            checked = plain.get("checked")
            return replace(made, checked=checked and datetime.fromisoformat(checked))
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise ConfigError(f"{name}: {error}; correct it or remove the file.") from None


@dataclass(frozen=True, slots=True)
class Due:
    """What to ask for now, and the schedule that knows of it."""

    entries: tuple[Entry, ...] = ()
    schedule: Schedule = field(default_factory=Schedule)


def due(schedule: Schedule, now: datetime) -> Due:
    """What has come due since the last look. `now` knows its time zone (local time)."""
    last = schedule.checked
    checked = replace(schedule, checked=now)
    passed = None if last is None else now.astimezone(UTC) - last.astimezone(UTC)
    if last is None or passed is None or passed <= timedelta():
        return Due((), checked)
    awake = passed <= AWAKE  # of real time: a change of summer time is no time
    wall, since = now.replace(tzinfo=None), last.replace(tzinfo=None)  # as clocks showed it
    earliest = since if awake else max(since, wall - GRACE)
    fired, entries = [], []
    for entry in schedule.entries:
        day = _day_of(entry, earliest, wall)
        if day is None or day == entry.fired:
            entries.append(entry)
            continue
        fired.append(entry)
        entries.append(replace(entry, fired=day))
    return Due(tuple(fired), replace(checked, entries=tuple(entries)))


def _day_of(entry: Entry, after: datetime, until: datetime) -> date | None:
    """The last day on which the entry's time lies in (after, until], None without one."""
    for back in (0, 1):
        day = (until - timedelta(days=back)).date()
        if day.weekday() in entry.days and after < datetime.combine(day, entry.at) <= until:
            return day
    return None


def read_days(text: str) -> frozenset[int]:
    """ "daily", or names of days by commas. Raises RequestError."""
    if text.strip().lower() in ("daily", "all"):
        return frozenset(range(7))
    names = [name.strip().lower()[:3] for name in text.split(",")]
    if not all(name in DAYS for name in names):
        raise RequestError(f"days {text[:40]!r}: give daily, or names such as mon,wed,fri.")
    return frozenset(DAYS.index(name) for name in names)


def read_time(text: str) -> time:
    """Hours and minutes: "09:30". Raises RequestError."""
    hours, colon, minutes = text.strip().partition(":")
    digits = colon and hours.isdecimal() and minutes.isdecimal() and len(minutes) == 2
    if digits and int(hours) < 24 and int(minutes) < 60:
        return time(int(hours), int(minutes))
    raise RequestError(f"time {text[:20]!r}: give hours and minutes such as 09:30.")
