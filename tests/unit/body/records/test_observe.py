"""What is kept of a life: all of a drive, little of rest, and never more than there is room for."""

import numpy as np
import pytest

from robot.body.records.newest import Newest
from robot.body.records.observe import NS, RESTING_NS, Observer
from robot.geometry.se2 import SE2
from robot.messages import MissionState, PoseEstimate, Scan, Seen, Tick

FRAME_NS = NS // 10


class Silent:
    """A log and a recorder that count what reaches them."""

    def __init__(self):
        self.count = 0

    def event(self, *_):
        self.count += 1

    command = truth = frame = event

    def flush(self): ...


@pytest.fixture
def watched():
    log, snapshots = Silent(), []
    return Observer(log, log, snapshots.append), log, snapshots


def live(observer, start_ns, seconds):
    """Frames at 10 Hz: truth at once, the estimate of it 0.1 m beside."""
    for k in range(10 * seconds):
        t_ns = start_ns + k * FRAME_NS
        observer.truth(t_ns, SE2(0.001 * k))
        observer.command(PoseEstimate(t_ns, SE2(0.001 * k, 0.1), np.eye(3), "ok"))


def state(observer, t_ns, name):
    observer.command(MissionState(t_ns, name, "so", 1.0, 1.0))


def test_a_drive_is_kept_whole(watched):
    observer, log, _ = watched
    state(observer, 0, "clean")
    live(observer, 0, 130)
    assert observer.estimates.shape == observer.true_track.shape == (1300, 4)
    assert np.allclose(np.diff(observer.estimates[:, 0]), 0.1)
    assert log.count == 1 + 2 * 1300


@pytest.mark.parametrize("rest", ["docked", "idle", "done"])
def test_of_rest_a_pose_a_minute_is_kept_and_everything_is_logged(watched, rest):
    observer, log, _ = watched
    state(observer, 0, rest)
    live(observer, 0, 600)
    assert len(observer.estimates) == 600 * NS // RESTING_NS
    assert np.array_equal(observer.estimates[:, 0], observer.true_track[:, 0])
    assert log.count == 1 + 2 * 6000
    state(observer, 600 * NS, "undock")
    live(observer, 600 * NS, 5)
    assert len(observer.estimates) == 10 + 50


def test_a_snapshot_tells_the_error_of_the_newest_pose(watched):
    observer, _, snapshots = watched
    state(observer, 0, "clean")
    live(observer, 0, 3)
    observer.event(Tick(3 * NS))
    assert snapshots[-1].pose_error_m == pytest.approx(0.1)
    assert snapshots[-1].covered_pct == 50.0


def test_times_of_stages_are_kept_by_name(watched):
    observer, *_ = watched
    scan = Scan(*np.zeros((3, 1)))
    for ms in (3.0, 5.0):
        observer.event(Seen(1, 1, 0, (), scan, 1.0, stage_ms={"scan": ms}))
    assert observer.stage_ms["scan"].tolist() == [3.0, 5.0]


def test_the_oldest_numbers_give_way():
    newest = Newest(2, 100)
    assert newest.rows.shape == (0, 2)
    for k in range(1050):
        newest.append(k, -k)
        assert len(newest) < 200
    rows = newest.rows
    assert len(rows) >= 100 and rows[-1].tolist() == [1049.0, -1049.0]
    assert np.array_equal(rows[:, 0], np.arange(1050 - len(rows), 1050))
