import cv2
import numpy as np
import pytest
from synthetic import camera, render, texture

from robot.config import PerceptionConfig
from robot.geometry.se2 import SE2
from robot.perception.point_stereo import measure
from robot.perception.tracks import SPACING_PX, Tracker, TrackIds, Tracks, turned

CAMERA = camera()
CONFIG = PerceptionConfig()
FAR = np.full(1000, -1.0)  # no floor anywhere


def smooth(image: np.ndarray) -> np.ndarray:
    return cv2.GaussianBlur(image, (0, 0), 1.0)


def view(pose: SE2, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    left, right, disparity = render(CAMERA, pose, noise=2.0, seed=seed)
    return smooth(left), smooth(right), disparity


def test_points_are_followed_where_the_world_moves_them():
    tracker = Tracker(CONFIG, CAMERA, TrackIds())
    poses = [SE2(0.02 * k, 0.0, 0.05 * k) for k in range(5)]
    frames = [view(pose, seed=k) for k, pose in enumerate(poses)]
    tracks, seen = None, {}
    for k, (left, _, _) in enumerate(frames):
        expected = turned(tracks.pixel, 0.05, CAMERA) if tracks else None
        tracks = tracker.follow(left, expected)
        assert len(set(tracks.track_id.tolist())) == len(tracks.track_id)
        for pixel, number, age in zip(tracks.pixel, tracks.track_id, tracks.age, strict=True):
            assert age == len(seen.get(int(number), []))
            seen.setdefault(int(number), []).append((k, pixel))
    errors = []
    for sightings in seen.values():
        (first, start), (last, end) = sightings[0], sightings[-1]
        if last - first < 3:
            continue
        u, v = start
        d = frames[first][2][round(float(v)), round(float(u))]
        x, y, z = CAMERA.base_from_pixel(np.array(u), np.array(v), np.array(d))
        there = (poses[last].inverse() @ poses[first]).apply(np.array([x, y]))
        expected = np.array(CAMERA.pixel_from_base(np.array([*there, z]))[:2])
        errors.append(np.linalg.norm(expected - end))
    assert len(errors) > 30
    assert np.median(errors) < 0.5 and np.mean(np.array(errors) < 2.0) > 0.85


def test_corners_keep_their_distance_and_the_count_its_bound():
    left, _, _ = view(SE2(0.0, 0.0, 0.3))
    tracker = Tracker(CONFIG, CAMERA, TrackIds())
    tracker.follow(left)
    tracks = tracker.follow(left)  # one half's corners are added in each frame
    assert 0.8 * CONFIG.max_tracks <= len(tracks.pixel) <= CONFIG.max_tracks
    upper = tracks.pixel[tracks.pixel[:, 1] < CAMERA.cy_px + SPACING_PX]
    gaps = np.linalg.norm(upper[:, None] - upper[None], axis=2) + 100 * np.eye(len(upper))
    assert gaps.min() > SPACING_PX - 4.3  # each may be sharpened by 1.5 px in u and in v
    assert len(upper) > len(tracks.pixel) / 2


def test_noise_has_no_corners():
    rng = np.random.default_rng(2)
    noise = np.clip(120 + 2 * rng.standard_normal((240, 320)), 0, 255).astype(np.uint8)
    assert len(Tracker(CONFIG, CAMERA, TrackIds()).follow(smooth(noise)).pixel) < 6


def test_a_cut_to_another_place_ends_nearly_all_tracks():
    tracker = Tracker(CONFIG, CAMERA, TrackIds())
    before = tracker.follow(view(SE2(0.0, 0.0, 0.0))[0])
    after = tracker.follow(view(SE2(0.3, -0.5, 2.5))[0])
    kept = np.isin(after.track_id, before.track_id)
    assert kept.sum() < 0.15 * len(before.track_id)


def test_numbers_are_never_used_twice():
    ids = TrackIds()
    taken = np.concatenate([ids.take(3), ids.take(0), ids.take(5)])
    assert taken.tolist() == list(range(8))


@pytest.mark.parametrize("yaw", [-0.3, 0.0, 0.2])
def test_far_points_move_with_the_turn(yaw):
    pixel = np.array([[100.0, 80.0], [160.0, 200.0], [220.0, 119.5]])
    rays = np.column_stack([pixel - [CAMERA.cx_px, CAMERA.cy_px], np.full(3, CAMERA.focal_px)])
    c, s = np.cos(yaw), np.sin(yaw)  # a left turn moves the world to the right
    x, y, z = (rays @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]).T).T
    expected = np.column_stack([x / z, y / z]) * CAMERA.focal_px + [CAMERA.cx_px, CAMERA.cy_px]
    np.testing.assert_allclose(turned(pixel, yaw, CAMERA), expected, atol=1e-3)


# ---------------------------------------------------------------- stereo of points


def tracks_at(pixel: np.ndarray) -> Tracks:
    number = np.arange(len(pixel))
    return Tracks(pixel.astype(np.float32), number, np.full(len(pixel), 9))


def shifted(disparity: float) -> tuple[np.ndarray, np.ndarray]:
    """A fronto-parallel wall with that disparity, sampled exactly."""
    wall = cv2.GaussianBlur(texture(9), (0, 0), 1.5)
    v, u = np.mgrid[0:240, 0:320].astype(np.float32)
    rng = np.random.default_rng(0)
    images = []
    for move in (0.0, disparity):
        grey = cv2.remap(wall, u + np.float32(100 + move), v + 100, cv2.INTER_CUBIC)
        grey = grey + 2.0 * rng.standard_normal(grey.shape)
        images.append(smooth(np.clip(grey, 0, 255).astype(np.uint8)))
    return images[0], images[1]


GRID = np.array([(u, v) for u in range(80, 300, 20) for v in range(20, 230, 20)], float)


@pytest.mark.parametrize("disparity", [3.3, 9.0, 17.65, 40.2])
def test_disparity_is_measured_to_a_fraction_of_a_pixel(disparity):
    left, right = shifted(disparity)
    dense = np.full(left.shape, disparity + 0.3, np.float32)  # a matcher off by a little
    points = measure(left, right, dense, tracks_at(GRID), np.full(len(GRID), -1.0))
    known = np.isfinite(points.disparity_px)
    assert known.mean() > 0.9 and points.steady.all()
    error = points.disparity_px[known] - disparity
    assert abs(np.median(error)) < 0.07
    assert 1.48 * np.median(np.abs(error)) < 0.2


def test_a_dense_answer_that_disagrees_or_is_missing_gives_nan():
    left, right = shifted(12.0)
    for dense in (np.full(left.shape, 16.0), np.full(left.shape, np.nan)):
        points = measure(left, right, dense.astype(np.float32), tracks_at(GRID), FAR[: len(GRID)])
        assert np.mean(np.isnan(points.disparity_px)) > 0.9


def test_a_depth_edge_is_not_steady():
    left, right = shifted(12.0)
    dense = np.full(left.shape, 12.0, np.float32)
    dense[:, 160:] = 20.0
    pixel = np.array([[100.0, 100.0], [159.0, 100.0], [162.0, 60.0], [250.0, 100.0]])
    steady = measure(left, right, dense, tracks_at(pixel), FAR[:4]).steady
    assert steady.tolist() == [True, False, False, True]


def test_floor_points_take_the_floor_s_disparity():
    left, right = shifted(12.0)
    dense = np.full(left.shape, 12.0, np.float32)
    pixel = np.array([[100.0, 150.0], [200.0, 150.0]])
    points = measure(left, right, dense, tracks_at(pixel), np.array([12.4, 20.0]))
    assert points.disparity_px[0] == 12.4
    assert points.disparity_px[1] == pytest.approx(12.0, abs=0.3)


def test_no_tracks_no_points():
    left, right = shifted(12.0)
    points = measure(
        left, right, np.zeros(left.shape, np.float32), tracks_at(np.empty((0, 2))), FAR[:0]
    )
    assert len(points.disparity_px) == 0
