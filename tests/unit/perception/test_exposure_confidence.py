import cv2
import numpy as np
import pytest
from synthetic import camera, render

from robot.config import PerceptionConfig
from robot.geometry.se2 import SE2
from robot.messages import DisparityMap
from robot.perception.confidence import Confidence
from robot.perception.exposure import Exposure

CAMERA = camera()
HERE = SE2(-0.5, 0.2, 0.1)


@pytest.fixture(scope="module")
def scene():
    return render(CAMERA, HERE, right_gain=0.8)


def answer(disparity: np.ndarray) -> DisparityMap:
    return DisparityMap(0, disparity, np.isfinite(disparity).astype(np.float32))


@pytest.fixture(scope="module")
def check():
    return Confidence(PerceptionConfig(), CAMERA).check


# ---------------------------------------------------------------- exposure


@pytest.mark.parametrize("gain", [0.7, 0.9, 1.0, 1.15])
def test_the_gain_is_learnt_from_what_both_eyes_see(gain):
    left, right, disparity = render(CAMERA, HERE, right_gain=gain)
    exposure = Exposure()
    for _ in range(25):
        alike = exposure.match(left, right)
        exposure.learn(left, alike, disparity)
    seen = np.rint(np.arange(320) - disparity[150]).astype(int)
    columns = np.flatnonzero((seen >= 0) & (left[150] < 200) & (left[150] > 20))
    ratio = left[150, columns] / alike[150, seen[columns]].astype(float)
    assert np.median(ratio) == pytest.approx(1.0, abs=0.02)


def test_a_wild_or_empty_pair_leaves_the_gain_within_reason():
    exposure = Exposure()
    bright, dark = np.full((240, 320), 250, np.uint8), np.zeros((240, 320), np.uint8)
    assert exposure.match(bright, dark).max() == 0
    exposure.learn(bright, dark, np.full((240, 320), np.nan, np.float32))
    assert exposure.match(dark, np.full((240, 320), 100, np.uint8)).max() <= 200


# ---------------------------------------------------------------- confidence


def test_true_disparity_is_believed(scene, check):
    left, right, truth = scene
    trusted = check(left, Exposure().match(left, right), answer(truth))
    inside = np.arange(320) > truth + 2
    known = np.isfinite(trusted.disparity_px)
    assert np.mean(known[inside]) > 0.97
    np.testing.assert_array_equal(trusted.disparity_px[known], truth[known])
    assert trusted.share == pytest.approx(np.mean(known))


def test_what_the_right_eye_cannot_see_is_unknown(scene, check):
    left, right, truth = scene
    trusted = check(left, Exposure().match(left, right), answer(truth))
    outside = np.arange(320) < truth - 1
    assert outside.any() and np.isnan(trusted.disparity_px[outside]).all()


def test_wrong_disparity_on_texture_is_not_believed(scene, check):
    left, right, truth = scene
    trusted = check(left, Exposure().match(left, right), answer(truth + 5.0))
    wall = np.isfinite(trusted.disparity_px)[5:110]  # floor at the robot's feet is blurred
    assert np.mean(wall) < 0.1


def test_hidden_pixels_are_unknown(check):
    # A near square over a far background: the strip left of it is hidden from the right eye.
    rng = np.random.default_rng(1)
    grain = cv2.GaussianBlur(rng.normal(0, 1, (240, 400)).astype(np.float32), (0, 0), 1.2)
    wall = np.clip(128 + 40 * grain / grain.std(), 0, 255).astype(np.uint8)
    left, right = wall[:, :320].copy(), wall[:, 5:325].copy()
    left[80:160, 150:250] = right[80:160, 120:220] = wall[:80, 300:400]
    truth = np.full((240, 320), 5.0, np.float32)
    truth[80:160, 150:250] = 30.0
    trusted = check(left, right, answer(truth)).disparity_px
    hidden = trusted[85:155, 126:149]
    assert np.mean(np.isnan(hidden)) > 0.95
    assert np.mean(np.isfinite(trusted[85:155, 155:245])) > 0.95


def test_plain_walls_do_not_make_obstacles(check):
    """Small invented blobs vanish, a large smooth surface may stay."""
    left, right, _ = render(CAMERA, HERE, plain_walls=True, noise=2.0)
    invented = np.full((240, 320), np.nan, np.float32)
    invented[20:25, 60:100] = 30.0
    invented[60:66, 200:230] = 45.0
    trusted = check(left, Exposure().match(left, right), answer(invented))
    assert np.isfinite(invented).sum() == 380
    assert np.mean(np.isfinite(trusted.disparity_px[np.isfinite(invented)])) < 0.05
    surface = np.full((240, 320), np.nan, np.float32)
    surface[10:100, 60:200] = 7.0
    trusted = check(left, Exposure().match(left, right), answer(surface))
    assert np.mean(np.isfinite(trusted.disparity_px[12:98, 62:198])) > 0.7


def test_the_matcher_s_own_doubt_counts(scene, check):
    left, right, truth = scene
    doubtful = DisparityMap(0, truth, np.full(truth.shape, 0.4, np.float32))
    assert check(left, Exposure().match(left, right), doubtful).share == 0.0
