import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace
from synthetic import camera, render, texture

from robot.config import PerceptionConfig
from robot.geometry.se2 import SE2
from robot.perception.descriptor import Describer
from robot.perception.edges import EdgeFinder
from robot.perception.floor import Floor
from robot.perception.landmarks import (
    SIGMA_D_PX,
    SIGMA_D_SHARE,
    SIGMA_U_PX,
    LandmarkMaker,
    polar,
)
from robot.perception.point_stereo import Points
from robot.perception.tracks import TrackIds
from robot.perception.vertical_edges import find_lines, slopes_of

CAMERA = camera()
CONFIG = PerceptionConfig()
EVERY_FRAME = replace(CONFIG, edge_every=1)
FLOOR = Floor(CAMERA).plane


def bits_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.unpackbits(a ^ b, axis=-1).sum(axis=-1)


# ---------------------------------------------------------------- descriptor


def smooth(image: np.ndarray) -> np.ndarray:
    return cv2.GaussianBlur(image, (0, 0), 1.0)


def scaled_wall(scale: float, rng: np.random.Generator) -> np.ndarray:
    """The same wall, its centre in the image's centre, `scale` times as large."""
    v, u = np.mgrid[0:240, 0:320].astype(np.float32)
    wall = cv2.GaussianBlur(texture(11), (0, 0), 2.0)
    # Averaged over pixels as a lens does, so that small scales do not alias.
    wall = cv2.GaussianBlur(wall, (0, 0), max(0.5 / scale, 0.01))
    x, y = (u - 159.5) / np.float32(scale) + 512, (v - 119.5) / np.float32(scale) + 512
    grey = cv2.remap(wall, x, y, cv2.INTER_LINEAR) + 2.0 * rng.standard_normal(u.shape)
    return np.clip(grey, 0, 255).astype(np.uint8)


def test_a_place_looks_the_same_from_any_distance_and_unlike_others():
    rng = np.random.default_rng(0)
    places = np.array([(x, y) for x in (-60, -20, 20, 60) for y in (-40, 0, 40)], float)
    centre = np.array([159.5, 119.5])
    described = {}
    for scale in (0.5, 0.8, 1.0, 1.4):
        image = scaled_wall(scale, rng)
        described[scale] = Describer(smooth(image)).describe(
            centre + scale * places, np.full(len(places), 60.0 * scale)
        )
        assert described[scale].shape == (len(places), 32)
        assert described[scale].dtype == np.uint8
    same = np.concatenate([bits_between(described[1.0], described[s]) for s in (0.5, 0.8, 1.4)])
    pairs = [(i, j) for i in range(len(places)) for j in range(i)]
    other = np.array([bits_between(described[1.0][i], described[1.0][j]) for i, j in pairs])
    assert np.median(same) < 25 and same.max() < other.min()
    assert np.median(other) > 90


def test_brightness_and_contrast_do_not_matter():
    image = scaled_wall(1.0, np.random.default_rng(1))
    darker = np.rint(image * 0.6 + 10).astype(np.uint8)
    pixel, width = np.array([[150.0, 110.0], [200.0, 90.0]]), np.array([50.0, 50.0])
    first, second = (Describer(smooth(i)).describe(pixel, width) for i in (image, darker))
    assert bits_between(first, second).max() < 12


def test_patches_that_leave_the_image_are_told():
    describer = Describer(np.zeros((240, 320), np.uint8))
    pixel = np.array([[160.0, 120.0], [5.0, 120.0], [160.0, 236.0], [25.0, 120.0]])
    inside = describer.inside(pixel, np.full(4, 60.0), 0.7)
    assert inside.tolist() == [True, False, False, True]


def test_nothing_described_is_nothing():
    describer = Describer(np.zeros((240, 320), np.uint8))
    assert describer.describe(np.empty((0, 2)), np.empty(0)).shape == (0, 32)


# ---------------------------------------------------------------- where, and how sure


@settings(max_examples=25, deadline=None)
@given(
    st.floats(20, 300),
    st.floats(30, 200),
    st.floats(3.0, 40.0),
    st.sampled_from([0.0, 0.1]),
)
def test_covariance_is_that_of_noisy_measurements(u, v, disparity, pitch):
    from robot.geometry.stereo import StereoCamera, base_from_cam

    mount = base_from_cam(0.13, 0.03, 0.09, pitch)
    eye = StereoCamera(320, 240, 228.0, 159.5, 119.5, 0.06, mount)
    _, _, cov = polar(eye, np.array([[u, v]]), np.array([disparity]))
    rng = np.random.default_rng(7)
    n = 4000
    small = 0.1  # keeps the transformation linear
    sigma_d = np.hypot(SIGMA_D_PX, SIGMA_D_SHARE * disparity)
    pixel = np.column_stack([u + small * SIGMA_U_PX * rng.standard_normal(n), np.full(n, v)])
    noisy = disparity + small * sigma_d * rng.standard_normal(n)
    range_m, bearing, _ = polar(eye, pixel, noisy)
    sampled = np.cov(np.stack([range_m, bearing])) / small**2
    scale = np.sqrt(np.outer(np.diag(cov[0]), np.diag(cov[0])))
    np.testing.assert_allclose(cov[0] / scale, sampled / scale, atol=0.1)


def test_range_and_bearing_are_of_the_foot_in_base():
    points = np.array([[1.4, 0.3, 0.4], [2.0, -0.8, 0.1]])
    u, v, d = CAMERA.pixel_from_base(points)
    range_m, bearing, _ = polar(CAMERA, np.column_stack([u, v]), d)
    np.testing.assert_allclose(range_m, np.hypot(points[:, 0], points[:, 1]), rtol=1e-9)
    np.testing.assert_allclose(bearing, np.arctan2(points[:, 1], points[:, 0]), rtol=1e-9)


# ---------------------------------------------------------------- who is chosen


def points_at(places: np.ndarray, age: int = 20, steady: bool = True) -> Points:
    u, v, d = CAMERA.pixel_from_base(places)
    count = len(places)
    return Points(
        np.column_stack([u, v]).astype(np.float32),
        d,
        np.full(count, steady),
        np.arange(count),
        np.full(count, age),
    )


BLANK = Describer(np.zeros((240, 320), np.uint8))


def made(points: Points) -> list:
    return LandmarkMaker(CONFIG, CAMERA).points(points, BLANK, FLOOR)


def test_floor_young_far_unsteady_and_unmatched_points_are_no_landmarks():
    good = np.array([[1.8, 0.2, 0.3]])
    assert [m.track_id for m in made(points_at(good))] == [0]
    assert made(points_at(good))[0].height_m == pytest.approx(0.3, abs=1e-6)
    assert made(points_at(np.array([[1.8, 0.2, 0.01]]))) == []
    assert made(points_at(np.array([[CONFIG.landmark_range_m + 1.0, 0.0, 0.3]]))) == []
    assert made(points_at(good, age=CONFIG.landmark_age - 1)) == []
    assert made(points_at(good, steady=False)) == []
    unmatched = points_at(good)
    unmatched.disparity_px[:] = np.nan
    assert made(unmatched) == []


def test_landmarks_are_bounded_spread_and_old_before_young():
    rng = np.random.default_rng(3)
    crowd = np.column_stack(
        [np.full(100, 2.0), rng.uniform(0.5, 0.9, 100), rng.uniform(0.1, 0.5, 100)]
    )
    alone = np.array([[2.0, -0.9, 0.3], [2.0, -0.2, 0.3]])
    points = points_at(np.vstack([crowd, alone]))
    points.age[:50] = 6
    points.age[-2:] = 6
    chosen = made(points)
    assert len(chosen) == CONFIG.max_landmarks
    numbers = {m.track_id for m in chosen}
    assert {100, 101} <= numbers  # young, but nobody else is there
    crowded = [k for k in numbers if k < 100]
    assert sum(k >= 50 for k in crowded) > 0.7 * len(crowded)
    assert len(numbers) == len(chosen)
    for landmark in chosen:
        assert landmark.kind == "point" and len(landmark.signature) == 32
        assert np.all(np.linalg.eigvalsh(landmark.cov) > 0)


def test_no_points_no_landmarks():
    assert made(points_at(np.empty((0, 3)))) == []


# ---------------------------------------------------------------- vertical edges


def bars(disparity: float, move: float = 0.0, noise: float = 2.0) -> tuple[np.ndarray, np.ndarray]:
    """Four vertical edges, drawn with sub-pixel accuracy, in both eyes."""
    rng = np.random.default_rng(5)
    images = []
    for shift in (0.0, disparity):
        u = np.arange(320 * 8) / 8.0 - 0.4375 + shift - move
        grey = 90 + 60 * ((u > 100.3) & (u < 140.8)) + 40 * ((u > 199.55) & (u < 260.1))
        row = grey.reshape(320, 8).mean(axis=1)
        image = np.tile(row, (240, 1)) + noise * rng.standard_normal((240, 320))
        images.append(smooth(np.clip(np.rint(image), 0, 255).astype(np.uint8)))
    return images[0], images[1]


PLACES = [100.3, 140.8, 199.55, 260.1]


def test_lines_are_found_to_a_fraction_of_a_pixel():
    lines = find_lines(slopes_of(bars(10.0)[0]), 2.0)
    order = np.argsort(lines.u)
    np.testing.assert_allclose(lines.u[order], PLACES, atol=0.1)
    assert lines.sign[order].tolist() == [1, -1, 1, -1]
    assert np.all(lines.bottom - lines.top > 220) and np.all(np.abs(lines.slope) < 0.005)


def test_slanted_short_and_faint_edges_are_no_lines():
    v, u = np.mgrid[0:240, 0:320]
    slanted = np.where(u > 100 + 0.2 * v, 160, 90)
    short = np.where((u > 100) & (u < 200) & (v > 100) & (v < 112), 160, 90)
    faint = np.where(u > 150, 91, 90)
    for image in (slanted, short, faint, np.full((240, 320), 90)):
        assert len(find_lines(slopes_of(smooth(image.astype(np.uint8))), 2.0).u) == 0


@pytest.mark.parametrize("disparity", [6.0, 11.4, 25.7])
def test_edges_become_landmarks_with_range_and_bearing(disparity):
    finder = EdgeFinder(EVERY_FRAME, CAMERA, TrackIds())
    dense = np.full((240, 320), disparity + 0.3, np.float32)
    numbers = []
    for k in range(CONFIG.landmark_age + 2):
        left, right = bars(disparity, move=1.5 * k)
        found = finder.find(left, right, dense, Describer(left), 0.0)
        numbers.append(sorted(m.track_id for m in found))
    assert numbers[0] == [] and len(numbers[-1]) >= 3  # young at first, then followed
    assert numbers[-1] == numbers[-2]
    z = CAMERA.focal_px * CAMERA.baseline_m / disparity
    for place in np.array(PLACES) + 1.5 * (CONFIG.landmark_age + 1):
        x, y = z + 0.13, 0.03 - (place - CAMERA.cx_px) * z / CAMERA.focal_px
        near = min(found, key=lambda m, at=(x, y): abs(m.bearing_rad - np.arctan2(at[1], at[0])))
        if abs(near.bearing_rad - np.arctan2(y, x)) > 0.02:
            continue  # its patch leaves the image
        assert near.kind == "edge" and np.isnan(near.height_m)
        assert near.range_m == pytest.approx(np.hypot(x, y), abs=3 * np.sqrt(near.cov[0, 0]))
        assert near.range_m == pytest.approx(np.hypot(x, y), rel=0.15 / disparity)


def test_edges_are_searched_in_every_so_many_frames_only():
    finder = EdgeFinder(replace(CONFIG, edge_every=3), CAMERA, TrackIds())
    left, right = bars(10.0)
    dense = np.full((240, 320), 10.3, np.float32)
    searched = []
    for k in range(3 * (CONFIG.landmark_age + 2)):
        searched += [k] if finder.find(left, right, dense, Describer(left), 0.0) else []
    first = 3 * CONFIG.landmark_age + 2
    assert searched == [k for k in (first, first + 3) if k < 3 * (CONFIG.landmark_age + 2)]


def test_an_edge_without_its_partner_is_left_out():
    finder = EdgeFinder(EVERY_FRAME, CAMERA, TrackIds())
    left, _ = bars(10.0)
    blank = np.full_like(left, 90)
    for dense in (np.full((240, 320), 10.0, np.float32), np.full((240, 320), np.nan, np.float32)):
        for _ in range(CONFIG.landmark_age + 2):
            assert finder.find(left, blank, dense, Describer(left), 0.0) == []


def test_points_and_edges_of_a_rendered_room_stay_where_they_are():
    """Seen from several places, a landmark's place in the room is the same within its sigma."""
    from robot.config import RobotConfig
    from robot.messages import StereoFrame
    from robot.perception.chain import Perception
    from robot.perception.depth import make_depth

    config = PerceptionConfig(matcher="given")
    perception = Perception(config, RobotConfig(), CAMERA, make_depth(config, CAMERA))
    places: dict[int, list[tuple[np.ndarray, float]]] = {}
    for k in range(10):
        pose = SE2(-0.6 + 0.04 * k, 0.1, 0.02 * k)
        left, right, disparity = render(CAMERA, pose, noise=2.0, seed=k)
        frame = StereoFrame(k, k, left, right, 0.02 if k else 0.0)
        for m in perception.see(frame, k, given=disparity).landmarks:
            base = m.range_m * np.array([np.cos(m.bearing_rad), np.sin(m.bearing_rad)])
            places.setdefault(m.track_id, []).append((pose.apply(base), float(m.cov[0, 0])))
    again = [sightings for sightings in places.values() if len(sightings) > 2]
    assert len(again) > 15
    away = [np.linalg.norm(s[-1][0] - s[0][0]) / np.sqrt(s[0][1]) for s in again]
    assert np.median(away) < 1.5 and np.mean(np.array(away) < 4.0) > 0.9
