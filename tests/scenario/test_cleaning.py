"""Whole runs in a light flat: what an owner sees, through the real brain, map and planner."""

import math

import pytest
from flat_boxes import one_room, small_flat
from flatland import Flatland, NoLog

from robot.brain import Brain
from robot.config import Config, ControlConfig, MissionConfig
from robot.geometry.se2 import SE2
from robot.messages import (
    ClearOrder,
    DriveCommand,
    MapReport,
    MissionState,
    PoseEstimate,
    StopOrder,
)
from robot.run import run


class Homing(Flatland):
    """Sends the robot home some seconds after a recovery that names a cause: short tests."""

    cause = ""

    def send(self, command):
        super().send(command)
        recovers = isinstance(command, MissionState) and command.state == "recover"
        if recovers and self.cause in command.reason and not self._requests:
            self._requests.append((command.t_ns * 1e-9 + 15.0, "dock"))
            self.cause = "never again"


def live(flat, seed=0, config=None, home_after="", **body_arguments):
    """One life; returns the body and the log."""
    config = config or Config()
    kind = Homing if home_after else Flatland
    body, log = kind(config, flat, seed, **body_arguments), NoLog()
    if home_after:
        body.cause = home_after
    run(body, Brain(config), log)
    return body, log


def reasons(body):
    return " | ".join(dict.fromkeys(f"{s.state}: {s.reason}" for s in body.states))


def speeds_between(body, start_s, end_s):
    return [d.v_mps for d in body.drives if start_s <= d.t_ns * 1e-9 < end_s]


@pytest.fixture(scope="module")
def clean_run():
    return live(small_flat(), seed=1, wheel_scale=1.005, gyro_bias_radps=0.01, duration_s=500)


def test_a_small_flat_is_cleaned_and_the_robot_docks(clean_run):
    body, _ = clean_run
    assert body.docked and body.phases[-1] == "done", reasons(body)
    assert body.covered_pct >= 90.0
    assert max([v for _, v in body.contacts], default=0.0) <= 0.15
    assert body.phases[:4] == ["docked", "starting", "undock", "look"]
    assert [p for p in body.phases if p in ("return", "dock")] == ["return", "dock"]


def test_reports_come_at_their_rates_and_every_state_has_a_reason(clean_run):
    body, log = clean_run
    seconds = body.drives[-1].t_ns * 1e-9
    count = {t: sum(isinstance(c, t) for c in log.commands) for t in (PoseEstimate, MapReport)}
    assert count[PoseEstimate] == pytest.approx(10 * seconds, rel=0.02)
    assert count[MapReport] == pytest.approx(seconds / 2, rel=0.1)
    assert len(body.drives) == pytest.approx(50 * seconds, rel=0.01)
    assert len(body.states) >= seconds * 0.95
    assert all(s.reason for s in body.states)
    assert body.states[-1].covered_m2 > 2.5


def test_the_estimate_is_near_the_truth(clean_run):
    body, log = clean_run
    errors = []
    for c in log.commands:
        k = c.t_ns // 100_000_000 - 1 if isinstance(c, PoseEstimate) else -1
        if 0 <= k < len(body.track):
            true = body.flat.start.inverse() @ body.track[k]
            errors.append(true.distance_m(c.world_from_base) ** 2)
    assert math.sqrt(sum(errors) / len(errors)) < 0.10


def test_brush_and_fan_run_only_while_sweeping(clean_run):
    body, _ = clean_run
    assert all(d.brush == 0.0 for d in body.drives if d.v_mps < 0.0)
    assert any(d.brush > 0.0 and d.fan > 0.0 for d in body.drives)
    assert body.drives[-1].brush == 0.0


def test_the_same_seed_gives_the_same_commands_bit_for_bit():
    lives = [live(one_room(), seed=4, duration_s=40)[1].commands for _ in range(2)]
    told = [[c for c in life if isinstance(c, DriveCommand | MissionState)] for life in lives]
    assert len(told[0]) > 1900
    for a, b in zip(*told, strict=True):
        assert repr(a) == repr(b)


def test_something_new_in_the_way_is_driven_round_softly():
    def put(body):
        boxes = [(1.45, 0.6, 1.6, 1.0), (0.95, 0.03, 1.15, 0.3)]
        body.flat.put(
            max(boxes, key=lambda b: math.hypot(b[0] - body.pose.x_m, b[1] - body.pose.y_m))
        )

    requests = [(0.5, "start"), (90.0, "dock")]
    body, _ = live(one_room(), seed=2, duration_s=200, requests=requests, at=[(20.0, put)])
    assert body.docked, reasons(body)
    assert body.covered_pct >= 50.0
    assert all(v <= 0.15 for _, v in body.contacts)


def test_an_invisible_obstacle_is_touched_remembered_and_left():
    flat = one_room(invisible=[(1.2, 0.75, 1.25, 0.80)])
    body, _ = live(flat, seed=3, duration_s=400, home_after="bumper was pressed")
    assert "recover" in body.phases and "bumper was pressed" in reasons(body)
    assert body.docked, reasons(body)
    at = [body.track[min(round(10.0 * t_s), len(body.track) - 1)] for t_s, _ in body.contacts]
    there = [pose for pose in at if math.hypot(pose.x_m - 1.225, pose.y_m - 0.775) < 0.3]
    assert 1 <= len(there) <= 8, (len(there), len(at))
    assert sum(isinstance(o, ClearOrder) for o in body.orders) >= 1


def test_a_cliff_is_never_entered():
    flat = one_room(cliffs=[(1.55, 0.0, 2.0, 0.6)])
    body, _ = live(flat, seed=5, duration_s=400, home_after="cliff")
    assert not body.cliff_entered
    assert "recover" in body.phases and "cliff" in reasons(body)
    assert body.docked, reasons(body)


def test_pause_resume_and_stop_are_obeyed_at_once():
    requests = [(0.5, "start"), (18.0, "pause"), (22.0, "resume"), (30.0, "stop"), (33.0, "dock")]
    body, _ = live(one_room(), seed=1, duration_s=90, requests=requests)
    assert max(map(abs, speeds_between(body, 18.3, 22.0))) == 0.0
    assert max(speeds_between(body, 22.5, 30.0)) > 0.1
    assert max(map(abs, speeds_between(body, 30.1, 33.0))) == 0.0
    assert any(isinstance(o, StopOrder) for o in body.orders)
    assert body.phases[-1] == "done" and body.docked, reasons(body)


def test_lost_sight_slows_then_stops_and_goes_on_when_it_returns():
    def blind(body):
        body.sees = False

    def seeing(body):
        body.sees = True

    body, _ = live(one_room(), seed=1, duration_s=32, at=[(20.0, blind), (26.0, seeing)])
    control = ControlConfig()
    assert max(speeds_between(body, 20.8, 21.3)) <= control.stale_mps
    assert max(map(abs, speeds_between(body, 21.7, 26.0))) == 0.0
    assert max(speeds_between(body, 26.5, 32.0)) > 0.1


def test_a_robot_that_stays_blind_says_so():
    def blind(body):
        body.sees = False

    config = Config(mission=MissionConfig(blind_limit_s=9.0))
    body, _ = live(one_room(), seed=1, config=config, duration_s=40, at=[(15.0, blind)])
    assert body.phases[-2:] == ["wheel-only", "error"], reasons(body)
    assert "nothing is seen" in body.states[-1].reason
    blind_drives = [d for d in body.drives if d.t_ns * 1e-9 > 18.0]
    assert max(abs(d.v_mps) for d in blind_drives) <= ControlConfig().wheel_only_mps
    assert all(d.brush == 0.0 for d in blind_drives)


def test_without_its_marker_docking_is_tried_and_given_up_with_a_reason():
    def hide(body):
        body.marker_hidden = True

    requests = [(0.5, "start"), (14.0, "dock")]
    body, _ = live(one_room(), seed=1, duration_s=200, requests=requests, at=[(13.0, hide)])
    assert body.phases[-1] == "error", reasons(body)
    assert body.states[-1].reason == "docking failed 3 times: the dock's marker was not seen"
    assert body.phases.count("dock") == 3 and not body.docked


def test_a_low_battery_brings_the_robot_home():
    def drain(body):
        body.battery_pct = 15.0

    def charge(body):
        body.battery_pct = 85.0

    config = Config(mission=MissionConfig(max_duration_s=30.0))
    at = [(25.0, drain), (60.0, charge)]
    body, _ = live(one_room(), seed=2, config=config, duration_s=160, at=at)
    assert "the battery is down to 15 %" in reasons(body)
    assert body.phases[-6:] == ["charge", "undock", "look", "clean", "return", "dock"] or (
        body.phases[-1] == "done" and "charge" in body.phases
    ), reasons(body)
    assert body.docked and "charged to 85 %, going on with the whole home" in reasons(body)


def test_time_is_bounded():
    config = Config(mission=MissionConfig(max_duration_s=30.0))
    body, _ = live(one_room(), seed=2, config=config, duration_s=120)
    assert "the time for this run is over" in reasons(body)
    assert body.docked and body.phases[-1] == "done"


def test_a_robot_that_is_held_gives_up_and_says_why():
    def wall_in(body):
        x, y = body.pose.x_m, body.pose.y_m
        body.flat.put((x - 0.2, y - 0.2, x + 0.2, y + 0.2), visible=False, but=(x, y, 0.18))

    body, _ = live(one_room(), seed=2, duration_s=150, at=[(25.0, wall_in)])
    assert body.phases[-1] == "error", reasons(body)
    assert "gave up" in body.states[-1].reason
    assert isinstance(body.orders[-1], StopOrder)


def test_lifted_wheels_stop_everything_until_they_are_down_again():
    def lift(body):
        body.wheel_drop = True

    def put_down(body):
        body.wheel_drop = False

    body, _ = live(one_room(), seed=1, duration_s=40, at=[(20.0, lift), (24.0, put_down)])
    assert max(map(abs, speeds_between(body, 20.1, 24.0))) == 0.0
    assert max(speeds_between(body, 24.5, 40.0)) > 0.1


def test_a_start_away_from_the_dock_looks_around_and_still_finds_the_dock():
    requests = [(0.5, "start"), (12.0, "dock")]
    body = Flatland(Config(), one_room(), 0, duration_s=60.0, requests=requests)
    body.pose = SE2(1.2, 0.9, 0.3)
    run(body, Brain(Config()), NoLog())
    assert body.phases[:4] == ["idle", "starting", "look", "clean"]
    assert body.docked, reasons(body)


def test_a_robot_that_never_saw_its_dock_says_so_when_it_shall_return():
    requests = [(0.5, "start"), (12.0, "dock")]
    body = Flatland(Config(), one_room(), 0, duration_s=60.0, requests=requests)
    body.pose, body.marker_hidden = SE2(1.2, 0.9, 0.3), True
    run(body, Brain(Config()), NoLog())
    assert body.phases[-1] == "error" and "not been seen" in body.states[-1].reason
