"""The diary: every run a folder of its own, complete when its summary is there."""

import json

import numpy as np
import pytest

from robot.body.records.diary import MIN_RUN_S, Diary
from robot.messages import Grid, MapReport, MissionState, Tick

NS = 1_000_000_000


class Watching:
    """What the diary needs of an observer."""

    def __init__(self):
        self.passed, self.flushed = [], 0
        self.estimates = np.zeros((0, 4))
        self.charging, self.map = False, None

    def event(self, event):
        self.passed.append(event)

    command = event

    def flush(self):
        self.flushed += 1

    def drive(self, start_s, count):
        """Estimates (t_s, x_m, y_m, yaw_rad) along x, 0.1 m apart."""
        t = start_s + np.arange(count, dtype=float)
        rows = np.column_stack([t, 0.1 * np.arange(count), 0.0 * t, 0.0 * t])
        self.estimates = np.vstack([self.estimates, rows])


@pytest.fixture
def book(tmp_path):
    """(diary, observer, folder of runs)."""
    watching, count = Watching(), iter(range(99))

    def folder(name):
        made = tmp_path / f"{name}-{next(count)}"
        made.mkdir()
        return made

    return Diary(watching, folder), watching, tmp_path


def say(diary, t_s, state, covered_m2=0.0, reason="so"):
    diary.command(MissionState(round(t_s * NS), state, reason, covered_m2, 1.0))


def pages(folder):
    return [json.loads(path.read_text()) for path in sorted(folder.glob("*/summary.json"))]


def test_everything_is_passed_on(book):
    diary, watching, _ = book
    tick, state = Tick(1), MissionState(2, "idle", "", 0.0, 0.0)
    diary.event(tick)
    diary.command(state)
    diary.flush()
    assert watching.passed == [tick, state] and watching.flushed == 1


def test_a_run_becomes_a_page_with_its_own_figures(book):
    diary, watching, folder = book
    watching.drive(0, 5)  # before the run
    say(diary, 5, "docked", 3.0)
    say(diary, 10, "undock", 3.0)
    watching.drive(10, 21)
    say(diary, 20, "clean", 4.0)
    say(diary, 25, "paused", 5.0)
    watching.charging = True
    grid = Grid(0.05, -1.0, -1.0, np.zeros((40, 60), np.int8))
    covered = np.zeros(grid.cells.shape, bool)
    watching.map = MapReport(0, grid, covered, np.zeros((0, 2)), np.zeros((0, 2, 2)))
    say(diary, 40, "done", 7.5, "all floor is clean")
    diary.flush()
    (page,) = pages(folder)
    assert page["duration_s"] == 30.0 and page["covered_m2"] == 4.5
    assert page["path_m"] == pytest.approx(2.0) and page["docked"] is True
    assert (page["state"], page["reason"]) == ("done", "all floor is clean")
    (run,) = folder.iterdir()
    assert len((run / "trajectory.tum").read_text().splitlines()[1:]) == 21
    assert (run / "map.png").read_bytes().startswith(b"\x89PNG")


def test_a_short_run_is_no_page_and_a_run_without_a_map_is_one(book):
    diary, watching, folder = book
    watching.drive(0, 3)
    say(diary, 0, "clean")
    say(diary, MIN_RUN_S - 0.1, "idle")
    diary.flush()
    assert pages(folder) == []
    say(diary, 20, "clean")
    watching.drive(20, 3)
    say(diary, 20 + MIN_RUN_S, "error", 1.0, "stuck")
    diary.flush()
    (page,) = pages(folder)
    assert page["state"] == "error"
    assert not list(folder.glob("*/map.png"))


@pytest.mark.parametrize("state", ["manual", "lifted", "lost"])
def test_driving_by_hand_and_being_carried_are_no_runs(book, state):
    diary, watching, folder = book
    say(diary, 0, "docked")
    watching.drive(0, 60)
    say(diary, 5, state)
    say(diary, 50, "idle")
    diary.flush()
    assert pages(folder) == []
    say(diary, 60, "clean")
    say(diary, 65, state)  # what has begun goes on
    say(diary, 70, "clean")
    say(diary, 80, "done")
    diary.flush()
    assert [page["duration_s"] for page in pages(folder)] == [20.0]


def test_a_second_run_counts_its_own_floor_only(book):
    """Whether the swept floor goes on counting, or begins at 0 again."""
    diary, watching, folder = book
    for start, first_m2, last_m2 in ((0, 0.0, 2.0), (100, 2.0, 5.0), (200, 0.0, 4.0)):
        say(diary, start, "clean", first_m2)
        watching.drive(start, 12)
        say(diary, start + 12, "docked", last_m2)
        diary.flush()
    assert [page["covered_m2"] for page in pages(folder)] == [2.0, 3.0, 4.0]


def test_a_run_that_saw_nothing_has_a_page_too(book):
    diary, _, folder = book
    say(diary, 0, "clean")
    say(diary, 30, "idle")
    diary.flush()
    assert pages(folder)[0]["path_m"] == 0.0
