"""Things go wrong: the robot gets out of it, or says why it stands, within a minute."""

import cv2
import numpy as np
import pytest

from robot.bench.faults.bench import bench_faults, run_fault
from robot.bench.faults.twelve import FAULTS
from robot.bench.trial import Trial
from robot.config import Config
from robot.errors import SweeperError

GOOD = ("resolved", "announced")


@pytest.fixture(autouse=True)
def one_thread():
    cv2.setNumThreads(1)


def test_an_empty_battery_stops_the_robot_with_a_word():
    row = run_fault("battery 5 %", 3, Config())
    assert row["result"] == "announced" and row["after_s"] < 2.0
    assert "5 %" in row["reason"] and "carry it home" in row["reason"]


def test_a_robot_that_is_carried_away_says_that_it_was_put_down():
    row = run_fault("lifted", 1, Config())
    assert row["result"] in GOOD and row["after_s"] <= 60.0
    assert "put down" in row["reason"]


def test_in_the_dark_it_creeps_with_the_brush_off_and_ends_with_a_reason():
    trial = Trial(Config(), "flat", 2)
    trial.end_s = 55.0

    def script(trial, t_s):
        trial.sight.dark |= t_s > 18.0

    trial.live(script)
    control = Config().control
    blind = [d for d in trial.drives if d.t_ns * 1e-9 > 20.6]
    assert max(abs(d.v_mps) for d in blind) <= control.wheel_only_mps + 1e-9
    assert max(abs(d.v_mps) for d in blind) > 0.05  # it does go home
    assert all(d.brush == d.fan == 0.0 for d in blind)
    names = [s.state for s in trial.states]
    assert "wheel-only" in names and trial.state in ("done", "error", "wheel-only")
    assert all(v <= 0.15 for _, v in trial.base.contacts)


def test_when_the_light_comes_back_it_goes_on():
    trial = Trial(Config(), "flat", 2)
    trial.end_s = 34.0

    def script(trial, t_s):
        trial.sight.dark = 20.0 < t_s < 25.0

    trial.live(script)
    told = [(s.state, s.reason) for s in trial.states]
    assert ("clean", "it sees again") in told
    assert max(d.v_mps for d in trial.drives if d.t_ns * 1e-9 > 27.0) > 0.12


def test_floor_on_which_the_wheels_slip_is_learned_and_told_to_the_planner():
    trial = Trial(Config(), "flat", 2)
    trial.end_s = 34.0
    slippery = []

    def script(trial, t_s):
        trial.base.faults.slip = 0.55 if 18.0 < t_s < 28.0 else 0.0
        if trial.base.faults.slip:
            slippery.append(trial.world.start.inverse() @ trial.pose)

    trial.live(script)
    view = trial.brain.home().grid
    ys, xs = np.nonzero(view.lost_pct >= 40)
    assert len(xs) * view.resolution_m**2 > 0.05
    x, y = ((v + 0.5) * view.resolution_m for v in (xs + view.ix0, ys + view.iy0))
    way = np.array([(pose.x_m, pose.y_m) for pose in slippery])
    far = np.hypot(x[:, None] - way[:, 0], y[:, None] - way[:, 1]).min(axis=1)
    assert far.max() < 0.45  # half a metre of way is what the wheels are judged by


def test_an_unknown_fault_is_refused_with_the_choices():
    with pytest.raises(SweeperError, match="cable"):
        bench_faults(1, ["gravity"], Config())


@pytest.mark.long
@pytest.mark.timeout(7200)
@pytest.mark.parametrize("name", [fault.name for fault in FAULTS])
def test_every_fault_ten_times(name):
    result = bench_faults(10, [name], Config())
    bad = [row for row in result["trials"] if row["result"] not in GOOD]
    assert not bad
    assert all(row["after_s"] <= 60.0 for row in result["trials"])
    assert all(row["max_contact_mps"] <= 0.15 for row in result["trials"])
