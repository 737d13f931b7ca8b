"""What an owner asks for, in a light flat: answers, places, drawings that hold, the dead man."""

import json
import math

import pytest
from flat_boxes import one_room, small_flat
from flatland import Flatland, NoLog

from robot.brain import Brain
from robot.config import Config
from robot.geometry.se2 import SE2
from robot.mapping.annotations import Annotations, Area, Line
from robot.messages import Beep, PlanOrder
from robot.run import run


def live(flat, requests, duration_s, *, at=(), annotations=None, place=None):
    """One life; returns the body, its log and its brain."""
    brain, log = Brain(Config()), NoLog()
    body = Flatland(Config(), flat, 3, duration_s=duration_s, requests=requests, at=at)
    if place is not None:
        body.pose = place
    if annotations is not None:
        brain.notes.change(annotations)
    run(body, brain, log)
    return body, log, brain


def in_world(body):
    """True poses in the frame of the map: the start on the dock."""
    return [body.flat.start.inverse() @ pose for pose in body.track]


def answers(body):
    return [(a.verb, a.accepted) for a in body.answers]


def test_every_request_is_answered_with_a_reason():
    requests = [
        (0.3, "resume"), (0.4, "dance"), (0.5, "start"), (1.0, "start"), (2.0, "spot"),
        (3.0, "pause"), (3.2, "pause"), (3.4, "go to 1 1"), (3.6, "resume"), (4.0, "stop"),
        (4.2, "stop"), (4.4, "pause"), (4.6, "locate"), (4.8, "history"), (5.0, "clean zones 1 2"),
    ]  # fmt: skip
    body, log, _ = live(one_room(), requests, 6.0)
    assert answers(body) == [
        ("resume", False), ("dance", False), ("start", True), ("start", False), ("spot", False),
        ("pause", True), ("pause", False), ("go", False), ("resume", True), ("stop", True),
        ("stop", True), ("pause", False), ("locate", True), ("history", False), ("clean", False),
    ]  # fmt: skip
    assert all(a.reason for a in body.answers)
    assert "undock" in body.answers[3].reason and "paused" in body.answers[7].reason
    assert sum(isinstance(c, Beep) for c in log.commands) == 1


def test_a_zone_is_swept_and_nothing_else():
    requests = [(0.5, "clean zones -1.2 0.1 -0.6 0.6")]
    body, _, _ = live(one_room(), requests, 150.0)
    assert body.docked and body.phases[-1] == "done", body.states[-1]
    assert "zone" in body.phases and "clean" not in body.phases
    swept = [p for p, on in zip(in_world(body), body.brushing, strict=True) if on]
    inside = [p for p in swept if -1.3 <= p.x_m <= -0.5 and 0.0 <= p.y_m <= 0.75]
    assert len(inside) > 20 and len(inside) > 0.5 * len(swept)
    assert body.states[-1].remaining_m2 < 0.1


def test_a_zone_is_saved_under_a_name_swept_by_it_and_forgotten():
    requests = [
        (0.3, "zone add 7 -1.2 0.1 -0.6 0.6"), (0.4, "zone add rug -1.2 0.1 -0.6 0.6"),
        (0.5, "zone add rug 0 0 1 1"), (0.6, "clean zones carpet"), (0.7, "clean zones Rug"),
        (19.0, "stop"), (19.2, "zone remove rug"), (19.4, "clean zones rug"),
    ]  # fmt: skip
    body, log, brain = live(one_room(), requests, 20.0)
    assert [a.accepted for a in body.answers] == [
        False,
        True,
        False,
        False,
        True,
        True,
        True,
        False,
    ]
    assert "rug" in body.answers[3].reason  # what there is instead
    assert "cleaning rug" in body.answers[4].reason
    orders = [c for c in log.commands if isinstance(c, PlanOrder) and c.kind == "coverage"]
    wanted = orders[-1].grid.resolution_m ** 2 * (~orders[-1].covered).sum()
    assert 0.15 < wanted < 0.31  # 0.6 m by 0.5 m, less what lies outside of the map
    assert brain.notes.current.zones == ()


def test_the_fan_works_as_hard_as_was_asked_and_the_home_keeps_it():
    requests = [
        (0.3, "fan"), (0.4, "fan Max"), (0.5, "start"), (20.0, "fan low"), (21.0, "fan turbo"),
        (26.0, "fan off"), (30.0, "stop"),
    ]  # fmt: skip
    body, _, brain = live(one_room(), requests, 31.0)
    assert [a.accepted for a in body.answers] == [True, True, True, True, False, True, True]
    assert "off, low, medium, high" in body.answers[4].reason
    told = json.loads(body.answers[0].data)
    assert told == {"level": "high", "levels": ["off", "low", "medium", "high"]}
    full = Config().mission.fan

    def fans(since_s, until_s):
        spans = (d for d in body.drives if since_s < d.t_ns * 1e-9 < until_s and d.brush > 0.0)
        return {round(d.fan, 3) for d in spans}

    assert fans(0.0, 20.0) == {full} and fans(20.1, 26.0) == {round(0.4 * full, 3)}
    assert fans(26.1, 30.0) == {0.0}
    assert brain.home().settings == {"fan": "off"}
    again = Brain(Config(), brain.home())
    assert again.home().settings == {"fan": "off"}


def test_a_spot_is_swept_where_the_robot_was_put_and_it_stays_there():
    body, _, _ = live(one_room(), [(0.5, "spot 0.8")], 90.0, place=SE2(1.2, 0.9, 0.3))
    assert "spot" in body.phases and body.phases[-1] == "idle", body.states[-1]
    assert math.hypot(body.pose.x_m - 1.2, body.pose.y_m - 0.9) < 0.8


def test_go_to_drives_there_and_waits():
    body, _, _ = live(one_room(), [(0.5, "start"), (14.0, "stop"), (15.0, "go to -1.0 0.2")], 40.0)
    at = in_world(body)[-1]
    assert body.phases[-1] == "idle" and "arrived" in body.states[-1].reason
    assert math.hypot(at.x_m + 1.0, at.y_m - 0.2) < 0.12


def test_driving_by_hand_ends_with_the_hand_and_obeys_the_gate():
    requests = [(1.0 + 0.1 * k, "manual -0.1 0.0") for k in range(20)]
    requests += [(4.0 + 0.1 * k, "manual 0.25 0.0") for k in range(40)]
    body, _, _ = live(one_room(), requests, 9.0, place=SE2(1.0, 0.8, 0.0))
    moving = [d.t_ns * 1e-9 for d in body.drives if abs(d.v_mps) > 1e-6]
    assert min(d.v_mps for d in body.drives) < -0.08
    last_backwards = max(t for t in moving if t < 3.9)
    assert last_backwards <= 2.9 + 0.3 + 0.02  # the last order came at 2.9 s
    assert body.phases[-1] == "manual"
    assert all(v <= 0.15 for _, v in body.contacts)  # it was driven against the wall
    assert max(body.drives, key=lambda d: d.v_mps).v_mps > 0.15
    assert all(d.brush == 0.0 for d in body.drives)


@pytest.fixture(scope="module")
def fenced():
    """A whole run in a flat with an area and a wall that must not be entered."""
    drawn = Annotations(
        (Area("area 1", ((-1.3, -1.1), (-0.8, -1.1), (-0.8, -0.7), (-1.3, -0.7))),),
        (Line("wall 1", (-1.53, -0.55), (-1.53, 0.3)),),
    )
    return live(small_flat(), [(0.5, "start")], 420.0, annotations=drawn), drawn


def test_what_is_forbidden_is_never_entered(fenced):
    (body, _, _), drawn = fenced
    away_m = min(drawn.distance_m(p.x_m, p.y_m) for p in in_world(body))
    assert away_m >= Config().robot.radius_m
    assert body.docked and body.phases[-1] == "done", body.states[-1]
    assert body.covered_pct > 20.0


def test_rooms_are_listed_named_and_cleaned_by_name(fenced):
    (body, _, brain), _ = fenced
    plain = json.loads(json.dumps(brain.notes.to_dict()))
    assert plain["current"]["walls"][0]["name"] == "wall 1"
    requests = [
        (0.5, "start"), (60.0, "rooms"), (62.0, "room name room-1 den"), (64.0, "stop"),
        (66.0, "clean rooms cellar"), (68.0, "clean rooms Den"), (69.0, "rooms"),
    ]  # fmt: skip
    body, _, _ = live(small_flat(), requests, 95.0)
    first, second = (a for a in body.answers if a.verb == "rooms")
    assert first.accepted and "room 1" in [r["name"] for r in json.loads(first.data)["rooms"]]
    assert "den" in [r["name"] for r in json.loads(second.data)["rooms"]]
    refused, accepted = (a for a in body.answers if a.verb == "clean")
    assert not refused.accepted and "den" in refused.reason
    assert accepted.accepted and "room" in body.phases
    assert all(a.t_ns * 1e-9 < 72.0 for a in body.answers)


def test_no_area_may_catch_the_robot_or_its_dock():
    requests = [
        (0.5, "no-go add -0.2 -0.2 0.2 0.2"), (0.8, "wall add 0.1 -1 0.1 1"),
        (1.0, "no-go add -2 -2 -1.5 -1.5"), (1.2, "map undo"), (1.4, "map undo"),
    ]  # fmt: skip
    body, _, brain = live(one_room(), requests, 2.0)
    assert [a.accepted for a in body.answers] == [False, False, True, True, False]
    assert "the robot" in body.answers[0].reason
    assert brain.notes.current == Annotations()
