"""SLAM over plain sights: odometry that finds its own errors, with and without names."""

from dataclasses import replace

import numpy as np
import pytest
from survey_course import LAG_S, SETTINGS, draw_course
from survey_course import SPEED_SCALE as TRUE_SPEED
from survey_course import TURN_SCALE as TRUE_TURN

from robot.geometry.se2 import SE2
from robot.slam.relocalise import rigid_fit
from robot.slam.survey import Survey
from robot.slam.survey.velocity import CURVATURE, LAG, SPEED_SCALE, TURN_SCALE, VelocityNoise


def drive(seed: int, named: bool, duration_s: float = 120.0, settings=SETTINGS):
    """The survey, its track (n, 3), the truth (n, 3) and what every sight was taken for."""
    orders, frames, truth = draw_course(seed, duration_s)
    survey = Survey(settings, orders, named)
    track, taken = [], []
    for t_s, polar, names in frames:
        survey.move(t_s)
        matched = survey.see(polar, names)
        track.append(survey.pose()[0])
        taken += list(zip(matched.tolist(), names.tolist(), strict=True))
    return survey, np.array(track), truth[:, 1:], taken


def rms_m(track: np.ndarray, truth: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.sum((track[:, :2] - truth[:, :2]) ** 2, axis=1))))


def aligned_rms_m(track: np.ndarray, truth: np.ndarray) -> float:
    return rms_m(rigid_fit(track[:, :2], truth[:, :2]).apply(track[:, :2]), truth)


def test_named_survey_learns_scales_and_lag_and_beats_dead_reckoning() -> None:
    survey, track, truth, _ = drive(1, named=True)
    assert rms_m(track, truth) < 0.08
    orders, frames, _ = draw_course(1)
    blind = Survey(SETTINGS, orders, named=True)
    dead = []
    for t_s, _, _ in frames:
        blind.move(t_s)
        dead.append(blind.pose()[0])
    assert rms_m(np.array(dead), truth) > 1.0
    learned = survey.ekf.calibration
    assert learned[SPEED_SCALE] == pytest.approx(TRUE_SPEED, abs=0.03)
    assert learned[TURN_SCALE] == pytest.approx(TRUE_TURN, abs=0.03)
    assert learned[LAG] == pytest.approx(LAG_S, abs=0.1)
    assert abs(learned[CURVATURE]) < 0.1


@pytest.mark.parametrize("invariant", [False, True])
def test_covariance_is_honest(invariant: bool) -> None:
    values = []
    for seed in range(2, 6):
        settings = replace(SETTINGS, invariant=invariant, start_sigma=(1e-3, 1e-3, 1e-3))
        orders, frames, truth = draw_course(seed, 60.0)
        survey = Survey(settings, orders, named=True)
        for (t_s, polar, names), true in zip(frames, truth, strict=True):
            survey.move(t_s)
            survey.see(polar, names)
            pose, cov = survey.pose()
            error = pose - true[1:]
            error[2] = (error[2] + np.pi) % (2 * np.pi) - np.pi
            if t_s > 5.0:
                values.append(error @ np.linalg.solve(cov, error))
    assert 0.5 < np.mean(values) < 6.0


def test_without_names_it_finds_every_thing_once() -> None:
    survey, track, truth, taken = drive(7, named=False)
    assert rms_m(track, truth) < 0.1
    shown = {landmark: name for landmark, name in taken if landmark >= 0}
    assert all(shown[landmark] == name for landmark, name in taken if landmark >= 0)
    things = [shown[name] for name in survey.map()[0]]
    assert len(set(things)) == len(things) >= len({name for _, name in taken}) - 1
    assert sum(landmark >= 0 for landmark, _ in taken) > 0.7 * len(taken)


def test_a_false_sight_does_not_move_the_pose_far() -> None:
    survey, _, _, _ = drive(8, named=True, duration_s=40.0)
    before = survey.pose()[0]
    names, places, _ = survey.map()
    x, y = SE2(*before.tolist()).inverse().apply(places[0])
    far = np.array([[2.5 * np.hypot(x, y), np.arctan2(y, x) + 0.4]])
    survey.see(far, np.array([names[0]]))
    assert np.hypot(*(survey.pose()[0] - before)[:2]) < 0.03


def test_same_input_same_map() -> None:
    first, track, _, _ = drive(9, named=False, duration_s=30.0)
    again, once_more, _, _ = drive(9, named=False, duration_s=30.0)
    assert np.array_equal(track, once_more)
    assert np.array_equal(first.ekf.P, again.ekf.P)


def test_a_thing_seen_twice_only_is_forgotten() -> None:
    settings = replace(SETTINGS, confirmations=1)
    survey = Survey(settings, np.array([[0.0, 0.0, 0.0]]), named=False)
    survey.move(0.0)
    survey.see(np.array([[2.0, 0.1]]))
    assert len(survey.map()[0]) == 1
    for t_s, count in ((1.0, 1), (100.0, 0)):
        survey.move(t_s)
        survey.see(np.empty((0, 2)))
        assert len(survey.map()[0]) == count


def test_a_name_placed_by_a_false_sight_is_placed_anew() -> None:
    survey = Survey(SETTINGS, np.array([[0.0, 0.0, 0.0]]), named=True)
    right = np.array([[2.0, 0.1]])
    survey.move(0.0)
    survey.see(np.array([[9.0, -0.5]]), np.array([7]))
    for k in range(1, 9):
        survey.move(0.5 * k)
        survey.see(right, np.array([7]))
    assert survey.map()[1][0] == pytest.approx([1.99, 0.2], abs=0.05)


def test_a_name_read_wrongly_once_leaves_nothing_behind() -> None:
    orders, frames, truth = draw_course(10, 60.0)
    rng = np.random.default_rng(10)
    survey, track = Survey(SETTINGS, orders, named=True), []
    for t_s, polar, names in frames:
        wrong = rng.uniform(size=len(names)) < 0.1
        survey.move(t_s)
        survey.see(polar, np.where(wrong, rng.integers(6, 18, len(names)), names))
        track.append(survey.pose()[0])
    assert rms_m(np.array(track), truth[:, 1:]) < 0.1
    names = survey.map()[0]
    assert len(set(names)) == len(names) <= 12


def test_where_the_first_heading_is_learned_late_the_track_told_is_truer() -> None:
    told, kept = [], []
    for seed in range(11, 17):
        orders, frames, truth = draw_course(seed, 60.0)
        survey = Survey(replace(SETTINGS, bearing_rad=0.1), orders, named=True)
        rng = np.random.default_rng(seed)
        track, raw = [], []
        for t_s, polar, names in frames:
            survey.move(t_s)
            survey.see(polar + [0.0, 0.1] * rng.normal(size=polar.shape), names)
            track.append(survey.pose()[0])
            raw.append(survey.ekf.x[:3].copy())
        told.append(aligned_rms_m(np.array(track), truth[:, 1:]))
        kept.append(aligned_rms_m(np.array(raw), truth[:, 1:]))
    assert np.mean(told) < 0.9 * np.mean(kept)


def test_two_sights_of_a_frame_are_two_things_however_near() -> None:
    survey = Survey(SETTINGS, np.array([[0.0, 0.0, 0.0]]), named=False)
    one, other = np.array([[1.0, 0.0]]), np.array([[1.0, 0.0], [1.06, 0.04]])
    for k in range(12):
        survey.move(0.5 * k)
        survey.see(one if k < 4 else other)
    assert len(survey.map()[0]) == 2


@pytest.mark.parametrize(("blind_s", "known_again"), [(2.0, True), (125.0, False)])
def test_after_a_long_blind_way_a_sight_may_show_something_new(
    blind_s: float, known_again: bool
) -> None:
    orders = np.array([[0.0, 0.0, 0.0], [5.0, 0.3, 0.05]])  # round a circle
    loose = replace(SETTINGS, noise=VelocityNoise(0.2, 0.2, 0.2, 0.1))
    survey = Survey(loose, orders, named=False)
    for k in range(9):
        survey.move(0.5 * k)
        survey.see(np.array([[1.5, 0.0]]))
    survey.move(5.0 + blind_s)
    pose, _ = survey.pose()
    _, places, _ = survey.map()
    x, y = SE2(*pose.tolist()).inverse().apply(places[0])
    sight = np.array([[np.hypot(x, y), np.arctan2(y, x)]])
    assert bool(survey.see(sight)[0] >= 0) is known_again
    assert survey.pose()[0] == pytest.approx(pose, abs=0.01)
