"""The whole chain on rendered frames: what it says is true, repeatable, or refused in words."""

from __future__ import annotations

import math
from dataclasses import fields, replace

import numpy as np
import pytest
from perception_views import CAMERA, CONFIG, DRIVE, flat, perception, view

from robot.config import PerceptionConfig
from robot.errors import FrameError
from robot.geometry.se2 import SE2
from robot.messages import Landmark, Seen
from robot.perception.chain import Perception
from robot.perception.depth import make_depth


def watch(**changes: object) -> list[Seen]:
    """The drive as seen by a fresh chain."""
    chain = perception(**changes)
    frames = [view(seq, pose) for seq, pose in enumerate(DRIVE)]
    return [chain.see(frame, frame.t_ns + 7, given=truth) for frame, truth in frames]


def place_m(landmark: Landmark) -> np.ndarray:
    bearing = landmark.bearing_rad
    return landmark.range_m * np.array([math.cos(bearing), math.sin(bearing)])


def test_frames_keep_their_stamps_and_the_stages_are_named() -> None:
    seen = watch()
    assert [s.seq for s in seen] == list(range(len(DRIVE)))
    assert all(s.arrived_ns == s.t_ns + 7 for s in seen)
    assert {"rectify", "disparity", "scan", "landmarks", "marker"} <= set(seen[0].stage_ms)
    assert all(0.3 < s.quality < 1.0 for s in seen)


def test_landmarks_stand_still_in_the_world_while_they_are_followed() -> None:
    tracks: dict[int, list[tuple[int, np.ndarray, float]]] = {}
    for s, pose in zip(watch(), DRIVE, strict=True):
        for landmark in s.landmarks:
            if landmark.kind == "point":
                sigma = math.sqrt(landmark.cov[0, 0])
                tracks.setdefault(landmark.track_id, []).append(
                    (s.seq, pose.apply(place_m(landmark)), sigma)
                )
    long = [track for track in tracks.values() if len(track) >= 3]
    assert len(long) > 15
    wander = [np.linalg.norm(t[-1][1] - t[0][1]) / (t[0][2] + 0.01) for t in long]
    assert np.median(wander) < 1.5
    assert np.mean(np.array(wander) < 4.0) > 0.9


def test_landmarks_lie_on_what_the_true_disparity_shows() -> None:
    errors = []
    for s, (seq, pose) in zip(watch(), enumerate(DRIVE), strict=True):
        _, truth = view(seq, pose)
        for landmark in s.landmarks:
            if landmark.kind != "point":
                continue
            u, v, d = CAMERA.pixel_from_base(np.array([*place_m(landmark), landmark.height_m]))
            row, column = round(float(v)), round(float(u))
            around = truth[max(row - 2, 0) : row + 3, max(column - 2, 0) : column + 3]
            errors.append(np.nanmin(np.abs(around - d)))
    assert len(errors) > 100
    assert np.median(errors) < 0.3
    assert np.mean(np.array(errors) < 1.0) > 0.95


def test_landmarks_obey_the_configuration() -> None:
    config = PerceptionConfig(max_landmarks=7, landmark_age=4, landmark_range_m=2.5, edges=False)
    seen = watch(max_landmarks=7, landmark_age=4, landmark_range_m=2.5, edges=False)
    for s in seen:
        assert len(s.landmarks) <= config.max_landmarks
        assert s.seq >= config.landmark_age or not s.landmarks
        for landmark in s.landmarks:
            depth_m = place_m(landmark)[0] - CAMERA.base_from_cam[0, 3]
            assert 0.0 < depth_m < config.landmark_range_m
            assert len(landmark.signature) == 32
            assert landmark.kind == "point" and landmark.height_m > 0.05
            assert np.all(np.linalg.eigvalsh(landmark.cov) > 0)
        ids = [landmark.track_id for landmark in s.landmarks]
        assert len(set(ids)) == len(ids)
    assert any(len(s.landmarks) == 7 for s in seen)


def test_signature_stays_the_same_from_frame_to_frame() -> None:
    def bits(a: Landmark, b: Landmark) -> int:
        pair = (np.frombuffer(x.signature, np.uint8) for x in (a, b))
        return int(np.unpackbits(np.bitwise_xor(*pair)).sum())

    *_, before, now = watch()
    old = {landmark.track_id: landmark for landmark in before.landmarks}
    same = [(old[x.track_id], x) for x in now.landmarks if x.track_id in old]
    assert len(same) > 5
    other = [(a, b) for a, _ in same for _, b in same if a.track_id != b.track_id]
    assert np.median([bits(a, b) for a, b in same]) < 25
    assert np.median([bits(a, b) for a, b in other]) > 60


def test_the_same_frames_give_the_same_answers() -> None:
    def flat_form(seen: Seen) -> list[object]:
        values: list[object] = [
            seen.quality,
            seen.scan.range_m.tobytes(),
            seen.scan.clear_m.tobytes(),
        ]
        for landmark in seen.landmarks:
            for field in fields(landmark):
                value = getattr(landmark, field.name)
                values.append(value.tobytes() if isinstance(value, np.ndarray) else repr(value))
        if seen.motion:
            values += [seen.motion.previous_from_current, seen.motion.cov.tobytes()]
        return values

    assert [flat_form(s) for s in watch()] == [flat_form(s) for s in watch()]


def test_the_marker_keeps_one_number_while_in_sight() -> None:
    chain = perception()
    numbers = []
    for seq, back in enumerate((0.3, 0.32, 0.34)):
        frame, _ = view(910 + seq, flat().start @ SE2(-back, 0.0, 0.0))
        seen = chain.see(frame, 0)
        assert seen.marker is not None
        numbers += [x.track_id for x in seen.landmarks if x.kind == "marker"]
    assert len(numbers) == 3 and len(set(numbers)) == 1 and numbers[0] >= 0


def test_a_frame_of_another_size_is_refused_in_one_sentence() -> None:
    frame, _ = view(0, DRIVE[0])
    small = replace(frame, left=frame.left[::2, ::2], right=frame.right[::2, ::2])
    with pytest.raises(FrameError, match="320x240"):
        perception().see(small, 0)


def test_given_disparity_is_needed_by_given_and_ignored_by_others() -> None:
    frame, truth = view(0, DRIVE[0])
    with pytest.raises(FrameError, match="given"):
        perception(matcher="given").see(frame, 0)
    with_truth, without = (perception().see(frame, 0, given=g).scan.range_m for g in (truth, None))
    assert np.array_equal(with_truth, without, equal_nan=True)


def test_darkness_is_survived_and_trusted_nowhere() -> None:
    frame, _ = view(0, DRIVE[0])
    dark = replace(frame, left=np.zeros_like(frame.left), right=np.zeros_like(frame.right))
    chain = perception()
    chain.see(frame, 0)
    seen = chain.see(dark, 0)
    assert seen.quality < 0.02 and not seen.landmarks and seen.motion is None
    assert np.all(np.isnan(seen.scan.range_m)) and np.all(seen.scan.clear_m == 0.0)
    assert chain.see(frame, 0).quality > 0.3


def test_the_clock_measures_the_stages() -> None:
    ticks = iter(range(0, 10**12, 1_000_000))
    config = PerceptionConfig()
    chain = Perception(
        config, CONFIG.robot, CAMERA, make_depth(config, CAMERA), clock=lambda: next(ticks)
    )
    frame, _ = view(0, DRIVE[0])
    assert set(chain.see(frame, 0).stage_ms.values()) == {1.0}
