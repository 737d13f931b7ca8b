"""The watch over the eyes: silent on good pairs, loud when a camera was knocked."""

import cv2
import numpy as np
import pytest

from robot.perception.epipolar import EpipolarWatch, row_offsets


def pair(rng, shift_px=0.0, roll_rad=0.0, disparity_px=12.0):
    """A textured scene of two depths; the right eye nods by `shift_px` and rolls."""
    big = cv2.GaussianBlur(rng.integers(0, 255, (300, 460)).astype(np.float32), (0, 0), 1.6)
    big = cv2.normalize(big, None, 0, 255, cv2.NORM_MINMAX)
    left = big[30:270, 60:380]
    near = np.zeros(left.shape, bool)
    near[120:, 100:220] = True
    v, u = np.mgrid[0:240, 0:320].astype(np.float32)
    shift = np.where(near, 2.0 * disparity_px, disparity_px).astype(np.float32)
    x, y = u - 160.0, v - 120.0
    source_u = 60 + 160 + x * np.cos(roll_rad) + y * np.sin(roll_rad) + shift
    source_v = 30 + 120 - x * np.sin(roll_rad) + y * np.cos(roll_rad) - shift_px
    right = cv2.remap(
        big, source_u.astype(np.float32), source_v.astype(np.float32), cv2.INTER_LINEAR
    )
    noisy = [np.clip(i + rng.normal(0, 2, i.shape), 0, 255).astype(np.uint8) for i in (left, right)]
    return noisy


def watched(**knock):
    watch = EpipolarWatch()
    rng = np.random.default_rng(1)
    for _ in range(8):
        watch.look(*pair(rng, **knock))
    return watch


def test_level_eyes_are_no_news():
    watch = watched()
    assert watch.offset_px < 0.15
    assert watch.problem == ""


@pytest.mark.parametrize("shift_px", [-2.5, -1.0, 1.0, 2.0, 4.0])
def test_a_nod_is_measured_and_told(shift_px):
    watch = watched(shift_px=shift_px)
    assert watch.offset_px == pytest.approx(abs(shift_px), abs=0.2)
    assert "a camera has moved" in watch.problem


def test_a_roll_is_told_although_the_middle_stays_level():
    watch = watched(roll_rad=0.02)
    assert watch.offset_px == pytest.approx(0.02 * 160 / np.sqrt(3), rel=0.25)
    assert watch.problem


def test_nothing_is_said_before_enough_is_seen():
    watch = EpipolarWatch()
    assert watch.problem == ""
    for _ in range(20):
        watch.look(np.full((240, 320), 90, np.uint8), np.full((240, 320), 90, np.uint8))
    assert np.isnan(watch.offset_px) and watch.problem == ""
    watch.look(*pair(np.random.default_rng(2), shift_px=3.0))
    watch = EpipolarWatch()
    watch.look(*pair(np.random.default_rng(2), shift_px=3.0))
    assert np.isnan(watch.offset_px)


def test_two_depths_give_points_on_the_same_rows():
    points = row_offsets(*pair(np.random.default_rng(3)))
    assert len(points) > 20
    assert np.median(np.abs(points[:, 2])) < 0.15
