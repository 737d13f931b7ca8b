"""The follower drives lanes accurately, turns in place at sharp corners and never goes back."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.config import ControlConfig, RobotConfig
from robot.control.follow import Follower
from robot.control.limits import Ramp
from robot.control.track import make_track
from robot.geometry.se2 import SE2, exp
from robot.messages import Path

CONTROL, ROBOT, HOME = ControlConfig(), RobotConfig(), SE2()
TICK_S = 0.02
LAG_S = 0.1


def lanes(n: int, length_m: float, spacing_m: float) -> np.ndarray:
    points = []
    for k in range(n):
        ends = [(0.0, k * spacing_m), (length_m, k * spacing_m)]
        points += ends if k % 2 == 0 else ends[::-1]
    return np.array(points)


def drive(points, start=HOME, max_s=300.0, noise_m=0.0, seed=0):
    """Follow the path with a body whose wheels lag; returns rows (x, y, yaw, v), time, progress."""
    rng = np.random.default_rng(seed)
    follower, ramp = (
        Follower(Path(np.asarray(points, float)), start, CONTROL, ROBOT),
        Ramp(CONTROL, ROBOT),
    )
    pose, v, w, trace, t = start, 0.0, 0.0, [], 0.0
    progress = []
    rolling_out = 25
    while rolling_out and t < max_s:
        rolling_out -= follower.done
        seen = SE2(
            pose.x_m + rng.normal(0, noise_m), pose.y_m + rng.normal(0, noise_m), pose.yaw_rad
        )
        steering = follower.steer(seen)
        want_v, want_w = ramp.step(steering.v_mps, steering.yaw_rate_radps, TICK_S)
        v += (want_v - v) * TICK_S / LAG_S
        w += (want_w - w) * TICK_S / LAG_S
        pose = pose @ exp(v * TICK_S, 0.0, w * TICK_S)
        trace.append((pose.x_m, pose.y_m, pose.yaw_rad, v))
        progress.append(follower.progress_m)
        t += TICK_S
    return follower, np.array(trace), t, progress


def distance_to_polyline(xy: np.ndarray, points: np.ndarray) -> np.ndarray:
    best = np.full(len(xy), np.inf)
    for a, b in pairwise(points):
        d = b - a
        f = np.clip(((xy - a) @ d) / (d @ d), 0.0, 1.0)
        best = np.minimum(best, np.hypot(*(xy - (a + f[:, None] * d)).T))
    return best


def test_lanes_are_driven_within_two_centimetres():
    points = lanes(6, 2.0, 0.18)
    follower, trace, t, _ = drive(points)
    assert follower.done
    middle = (trace[:, 0] > 0.15) & (trace[:, 0] < 1.85)
    nearest_lane = np.abs(trace[:, 1] / 0.18 - np.round(trace[:, 1] / 0.18)) * 0.18
    assert nearest_lane[middle].max() < 0.02
    assert t < 6 * 2.0 / 0.25 + 5 * 4.5  # brisk: a hairpin costs less than two turns in place
    assert trace[:, 0].max() < 2.02 and trace[:, 0].min() > -0.02  # hairpins stay inside the lanes


def test_a_shaking_pose_is_still_followed():
    _, trace, _, _ = drive(lanes(3, 2.0, 0.18), noise_m=0.01, seed=3)
    middle = (trace[:, 0] > 0.15) & (trace[:, 0] < 1.85)
    nearest_lane = np.abs(trace[:, 1] / 0.18 - np.round(trace[:, 1] / 0.18)) * 0.18
    assert nearest_lane[middle].max() < 0.02


def test_turns_in_place_at_a_sharp_corner_and_does_not_cut_it():
    points = np.array([[0, 0], [1.0, 0], [1.0, 1.0]], float)
    _, trace, _, _ = drive(points)
    assert distance_to_polyline(trace[:, :2], points).max() < 0.02
    turning = trace[(np.abs(trace[:, 2]) > 0.4) & (np.abs(trace[:, 2]) < 1.2)]
    assert np.abs(turning[:, 3]).max() < 0.03


def test_ends_at_the_end_of_the_path():
    _, trace, _, _ = drive([[0, 0], [0.7, 0.3], [1.5, 0.3]])
    assert math.hypot(trace[-1, 0] - 1.5, trace[-1, 1] - 0.3) < 0.03
    assert abs(trace[-1, 3]) < 0.01


def test_what_was_passed_is_skipped():
    points = [[0, 0], [2, 0]]
    follower = Follower(Path(np.array(points, float)), SE2(0.3, 0.01, 0.0), CONTROL, ROBOT)
    assert 0.28 <= follower.progress_m <= 0.32
    steering = follower.steer(SE2(0.3, 0.01, 0.0))
    assert steering.v_mps > 0.2 and not steering.turning


def test_starts_with_a_turn_when_the_path_leads_backwards():
    follower = Follower(Path(np.array([[0, 0], [-1, 0]], float)), SE2(), CONTROL, ROBOT)
    steering = follower.steer(SE2())
    assert steering.turning and steering.v_mps == 0.0 and abs(steering.yaw_rate_radps) > 0.5


def test_an_empty_or_single_point_path_is_done_at_once():
    for points in (np.empty((0, 2)), np.array([[1.0, 2.0]])):
        follower = Follower(Path(points), SE2(), CONTROL, ROBOT)
        assert follower.done and follower.remaining_m == 0.0
        assert follower.steer(SE2()).v_mps == 0.0
        assert follower.ahead(1.0).shape == (0, 2)


def test_ahead_shows_the_next_stretch_only():
    follower = Follower(Path(np.array([[0, 0], [5, 0]], float)), SE2(), CONTROL, ROBOT)
    ahead = follower.ahead(1.0)
    assert ahead[:, 0].max() <= 1.0 + 1e-9 and ahead[:, 0].max() > 0.9 and len(ahead) > 15


def test_a_hairpin_is_rounded_and_a_lone_right_angle_is_a_stop():
    hairpin = make_track(lanes(2, 2.0, 0.18), CONTROL, ROBOT, 0.25)
    assert sum(hairpin.stop) == 1  # only the end
    assert max(abs(k) for k in hairpin.curvature_radpm) == pytest.approx(1 / 0.09, rel=1e-6)
    corner = make_track(np.array([[0, 0], [1, 0], [1, 1]], float), CONTROL, ROBOT, 0.25)
    assert sum(corner.stop) == 2


def test_a_gentle_corner_is_cut_by_no_more_than_allowed():
    points = np.array([[0, 0], [1, 0], [1.8, 0.8]], float)
    track = make_track(points, CONTROL, ROBOT, 0.25)
    xy = np.column_stack([track.x_m, track.y_m])
    assert sum(track.stop) == 1
    assert distance_to_polyline(xy, points).max() <= CONTROL.corner_cut_m + 1e-9


def test_speeds_of_a_track_can_be_kept():
    track = make_track(lanes(4, 1.5, 0.18), CONTROL, ROBOT, 0.25)
    v, s = np.array(track.speed_mps), np.array(track.station_m)
    assert v.max() <= 0.25 and v[-1] == 0.0
    drop = np.maximum(0.0, v[:-1] ** 2 - v[1:] ** 2)
    assert np.all(drop <= 2 * CONTROL.brake_mps2 * np.diff(s) + 1e-9)
    assert np.all(np.abs(track.curvature_radpm) * v <= ROBOT.max_yaw_rate_radps + 1e-9)


coordinate = st.floats(-3, 3)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.tuples(coordinate, coordinate), min_size=2, max_size=7), coordinate, coordinate)
def test_any_path_ends_and_progress_never_goes_back(points, yaw, y):
    follower, trace, t, progress = drive(
        points, SE2(points[0][0], points[0][1] + 0.05 * y, yaw), 240
    )
    assert follower.done and t < 240
    assert all(b >= a for a, b in pairwise(progress))
    end = make_track(np.array(points), CONTROL, ROBOT, 0.25)
    if len(end):
        assert math.hypot(trace[-1, 0] - end.x_m[-1], trace[-1, 1] - end.y_m[-1]) < 0.1
