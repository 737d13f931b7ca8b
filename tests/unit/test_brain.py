"""The brain's wiring: what each event leads to."""

import numpy as np

from robot.brain import Brain
from robot.config import Config
from robot.messages import (
    Battery,
    Contact,
    DriveCommand,
    ImuSample,
    LinkState,
    MapReport,
    MissionState,
    PlanOrder,
    PoseEstimate,
    Request,
    Scan,
    Seen,
    Tick,
    WheelTravel,
)

MS = 1_000_000
BEARINGS = np.linspace(-0.6, 0.6, 41)


def seen(t_ns, wall_m=1.5):
    scan = Scan(BEARINGS, wall_m / np.cos(BEARINGS), np.full(41, wall_m - 0.05))
    return Seen(t_ns, t_ns, t_ns // (100 * MS), (), scan, 1.0)


def beat(brain, t_ns, *, charging=False, left_m=0.0, right_m=0.0):
    """One tick with healthy senses; returns what the tick gave."""
    for event in (
        WheelTravel(t_ns, t_ns, left_m, right_m),
        ImuSample(t_ns, 0.0),
        Contact(t_ns, charging=charging),
        LinkState(t_ns, True),
        Battery(t_ns, 15.0, 90.0),
    ):
        assert brain.on(event) == []
    return brain.on(Tick(t_ns))


def only(commands, kind):
    return [c for c in commands if isinstance(c, kind)]


def test_every_tick_gives_exactly_one_drive_command_and_it_denies_at_first():
    brain = Brain(Config())
    brain.on(Request(0, "start"))
    (order,) = only(brain.on(Tick(20 * MS)), DriveCommand)
    assert (order.v_mps, order.yaw_rate_radps, order.brush) == (0.0, 0.0, 0.0)
    assert "no news" in order.reason and order.valid_for_ms == 200


def test_a_frame_gives_a_pose_at_its_own_time_and_a_map_now_and_then():
    brain = Brain(Config())
    first = brain.on(seen(100 * MS))
    assert [type(c) for c in first] == [PoseEstimate, MapReport]
    assert first[0].t_ns == 100 * MS
    assert (first[1].grid.cells == 0).any() and first[1].covered.shape == first[1].grid.cells.shape
    assert [type(c) for c in brain.on(seen(200 * MS))] == [PoseEstimate]


def test_the_map_is_drawn_where_the_robot_was_when_the_frame_was_taken():
    """The frame is 0.3 s old and the robot has driven on: the wall must not move with it."""
    brain = Brain(Config())
    for k in range(50):
        travel_m = 0.2 * k * 0.02
        beat(brain, 20 * MS * k, left_m=travel_m, right_m=travel_m)
    brain.on(seen(700 * MS, wall_m=0.7))  # taken at x = 0.14, told at x = 0.196
    later = [brain.on(seen(t_ms * MS, wall_m=np.nan)) for t_ms in (680, 4_000)]
    report = only(later[0], MapReport) or only(later[1], MapReport)
    grid = report[0].grid
    row = int((0.0 - grid.origin_y_m) / grid.resolution_m)
    wall = np.flatnonzero(grid.cells[row] == 100)
    x_m = grid.origin_x_m + (wall[0] + 0.5) * grid.resolution_m
    assert abs(x_m - 0.84) < 0.04


def test_start_on_the_dock_undocks_and_away_from_it_looks_around():
    for charging, state in ((True, "undock"), (False, "look")):
        brain = Brain(Config())
        brain.on(seen(0))
        beat(brain, 20 * MS, charging=charging)
        brain.on(Request(30 * MS, "start"))
        commands = beat(brain, 40 * MS, charging=charging)
        assert only(commands, MissionState)[0].state == state
        orders = [c for k in range(3, 30) for c in beat(brain, 20 * MS * k, charging=charging)]
        last = only(orders, DriveCommand)[-1]
        assert last.v_mps < 0.0 if charging else last.yaw_rate_radps > 0.0


def test_a_look_around_ends_in_an_order_for_a_plan():
    brain = Brain(Config())
    beat(brain, 20 * MS)
    brain.on(Request(20 * MS, "start"))
    plans, yaw, k = [], 0.0, 1
    while not plans and k < 1000:
        k += 1
        t_ns = 20 * MS * k
        yaw += 0.8 * 0.02
        half = 0.5 * Config().robot.track_width_m * yaw
        brain.on(WheelTravel(t_ns, t_ns, -half, half))
        brain.on(Contact(t_ns))
        brain.on(LinkState(t_ns, True))
        if k % 5 == 0:
            brain.on(seen(t_ns))
        plans = only(brain.on(Tick(t_ns)), PlanOrder)
    assert plans and plans[0].kind == "coverage"
    assert (plans[0].grid.cells == 0).sum() * plans[0].grid.resolution_m ** 2 > 3.0
    assert 5.0 < k * 0.02 < 9.0


def test_a_pose_that_the_map_confirms_is_believed_at_once():
    brain = Brain(Config())
    beat(brain, 100 * MS)
    brain.on(seen(100 * MS))
    brain.on(Contact(120 * MS, wheel_drop=True))
    brain.on(seen(200 * MS))
    now = brain._situation(220 * MS)
    assert now.health == "lost"
    now.settle()
    assert brain._situation(240 * MS).health == "ok"
