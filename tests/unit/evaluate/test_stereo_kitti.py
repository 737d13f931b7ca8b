"""KITTI's measures against values worked out by hand."""

import numpy as np
import pytest

from robot.evaluate.stereo_kitti import kitti_error_picture, kitti_errors

NAN = np.nan
#                 exact  2.9  3.0 of 10  4 of 100  6 of 100  empty  no truth  3.5 of 20
TRUTH = np.array([[10.0, 10.0, 10.0, 100.0, 100.0, 10.0, NAN, 20.0]])
FOUND = np.array([[10.0, 12.9, 13.0, 104.0, 94.0, NAN, 55.0, 16.5]])


def test_outliers_by_hand():
    front = np.array([[1, 1, 1, 0, 0, 0, 1, 0]], bool)
    found = kitti_errors(FOUND, TRUTH, front)
    # Foreground: only the pixel that is off by 3.0. Background: 4 of 100 is within 5 %, the rest
    # is not: 6 of 100, the empty one, 3.5 of 20.
    assert found.d1_fg_pct == pytest.approx(100 / 3)
    assert found.d1_bg_pct == pytest.approx(75.0)
    assert found.d1_all_pct == pytest.approx(100 * 4 / 7)
    # KITTI 2012 knows no 5 %, and 3.0 is not more than 3: 4, 6, empty, 3.5.
    assert found.out_pct == pytest.approx(100 * 4 / 7)
    assert found.avg_px == pytest.approx((0 + 2.9 + 3.0 + 4.0 + 6.0 + 3.5) / 6)


def test_without_objects_and_without_truth():
    assert np.isnan(kitti_errors(FOUND, TRUTH).d1_fg_pct)
    nothing = kitti_errors(FOUND, np.full_like(TRUTH, NAN))
    assert np.isnan(nothing.d1_all_pct) and np.isnan(nothing.avg_px)
    with pytest.raises(ValueError, match="differ in size"):
        kitti_errors(FOUND[:, 1:], TRUTH)


def test_colours_by_hand():
    picture = kitti_error_picture(FOUND, TRUTH)[0]
    assert picture[0].tolist() == [49, 54, 149]  # exact: darkest blue
    assert picture[1].tolist() == [224, 243, 248]  # 2.9 / 3 = 0.97
    assert picture[2].tolist() == [254, 224, 144]  # 3.0 / 3 = 1
    assert picture[3].tolist() == [224, 243, 248]  # 4 / max(3, 5) = 0.8
    assert picture[4].tolist() == [254, 224, 144]  # 6 / 5 = 1.2
    assert picture[5].tolist() == [165, 0, 38]  # empty: darkest red
    assert picture[6].tolist() == [0, 0, 0]  # no truth
    tenth = kitti_error_picture(np.array([[10.3]]), np.array([[10.0]]))
    assert tenth[0, 0].tolist() == [69, 117, 180]  # 0.3 / 3 = 0.1
    assert kitti_error_picture(np.array([[25.0]]), np.array([[10.0]])).tolist() == [
        [[244, 109, 67]]
    ]


def test_blue_and_red_part_where_d1_does():
    rng = np.random.default_rng(0)
    truth = rng.uniform(1, 150, (40, 50))
    found = truth + rng.normal(0, 6, truth.shape)
    red_is_more = kitti_error_picture(found, truth).astype(int)
    wrong = red_is_more[..., 0] > red_is_more[..., 2]
    assert 100 * wrong.mean() == pytest.approx(kitti_errors(found, truth).d1_all_pct)
