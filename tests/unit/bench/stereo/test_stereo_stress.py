"""Stress, confidence and native sizes of the stereo bench; the matchers give known answers."""

import cv2
import numpy as np
import pytest

from robot.bench.stereo import confidence as stereo_confidence
from robot.bench.stereo import native as stereo_native
from robot.bench.stereo import stress as stereo_stress
from robot.bench.stereo.matchers import Matcher
from robot.bench.stereo.pairs import TruePair, as_it_is, find_pairs
from robot.errors import DataError


def wide_pair(folder, height=120, width=400, shift=16):
    """A KITTI 2015 folder with one textured pair of a single disparity."""
    rng = np.random.default_rng(3)
    image = cv2.GaussianBlur(
        rng.integers(0, 256, (height, width + shift), dtype=np.uint8), (0, 0), 1.5
    )
    image = cv2.normalize(image, None, 0, 255, cv2.NORM_MINMAX)
    truth = np.full((height, width), 256 * shift, np.uint16)
    truth[:, :shift] = 0
    files = {"image_2": image[:, :width], "image_3": image[:, shift:], "disp_noc_0": truth}
    for name, picture in files.items():
        (folder / "training" / name).mkdir(parents=True)
        cv2.imwrite(str(folder / "training" / name / "000003_10.png"), picture)
    return folder


def flat_pair():
    grey = np.full((240, 320), 100, np.uint8)
    truth = np.full((240, 320), 10.0, np.float32)
    return TruePair("flat", "middlebury", grey, grey, truth, np.ones((240, 320), bool))


@pytest.fixture
def one_pair(monkeypatch):
    for module in (stereo_stress, stereo_confidence):
        monkeypatch.setattr(module, "find_pairs", lambda folder: [flat_pair()])


def use(monkeypatch, module, matchers):
    made = {m.name: m for m in matchers}
    monkeypatch.setattr(module, "make_matcher", lambda name, models, threads: made[name])


def test_disturbances_change_what_they_say():
    rng = np.random.default_rng(0)
    texture = rng.integers(30, 200, (240, 320)).astype(np.uint8)
    pair = TruePair("t", "eth3d", texture, texture, np.ones((240, 320)), texture > 0)
    for name in stereo_stress.DISTURBANCES:
        found = stereo_stress.disturbed(pair, name, 0)
        assert found.left.dtype == found.right.dtype == np.uint8
        assert np.array_equal(found.right, texture) == (name == "none")
        assert np.array_equal(found.left, texture) == ("right eye" in name or name == "none")
    lower = stereo_stress.disturbed(pair, "right eye 1 px lower", 0).right
    np.testing.assert_array_equal(lower[1:], texture[:-1])
    noisy = stereo_stress.disturbed(pair, "noise sigma 5", 0).left.astype(float) - texture
    assert noisy.std() == pytest.approx(5, rel=0.1)


def test_growth_is_relative_to_the_calm_pair(monkeypatch, one_pair, tmp_path):
    def match(left, right):  # wrong as soon as the eyes differ
        return np.full((240, 320), 10.0 if np.array_equal(left, right) else 20.0, np.float32)

    use(monkeypatch, stereo_stress, [Matcher("picky", match, None, lambda a, b: 0.3 + 0 * a)])
    result = stereo_stress.bench_stress(tmp_path, ["picky"])
    by_name = {r["disturbance"]: r for r in result["stress"]}
    assert by_name["none"]["bad2_pct"] == 0.0
    assert by_name["exposure x0.7, right eye"]["growth_pct"] == 100.0
    assert by_name["blur sigma 1.5"]["growth_pct"] == 0.0
    assert result["swapped"] == [
        {"matcher": "picky", "believed_pct": 0.0, "believed_swapped_pct": 0.0}
    ]


def test_confidence_is_compared_at_the_density_of_sgbm(monkeypatch, one_pair, tmp_path):
    half = np.full((240, 320), np.nan, np.float32)
    half[:120] = 10.0
    half[:60] = 15.0  # half of what it keeps is wrong
    whole = np.full((240, 320), 10.0, np.float32)
    whole[200:] = 15.0
    trust = np.ones((240, 320), np.float32)
    trust[160:] = 0.1
    sgbm = Matcher("sgbm", lambda a, b: half)
    network = Matcher("net", lambda a, b: whole, None, lambda a, b: trust)
    use(monkeypatch, stereo_confidence, [sgbm, network])
    rows = stereo_confidence.bench_confidence(tmp_path, ["net", "bm"])["confidence"]
    assert rows == [
        {"matcher": "sgbm", "density_pct": 50.0, "bad2_pct": 50.0},
        {"matcher": "net", "density_pct": 50.0, "bad2_pct": 0.0},
    ]


def test_the_most_trusted_pixels_are_as_many_as_asked():
    trust = np.array([[0.1, 0.9], [0.5, 0.5]])
    assert stereo_confidence.most_trusted(trust, 2).tolist() == [[False, True], [True, False]]
    assert not stereo_confidence.most_trusted(trust, 0).any()


def test_native_size_is_kept_and_measured(tmp_path):
    folder = wide_pair(tmp_path)
    (pair,) = find_pairs(folder, as_it_is)
    assert pair.left.shape == (120, 400)
    assert np.nanmax(pair.truth_px) == 16
    result = stereo_native.bench_native(folder, ["sgbm"])
    assert result["size"] is None
    one = next(r for r in result["rows"] if r["pair"] == "000003" and r["filled"])
    assert one["size"] == [400, 120]
    assert one["d1_all_pct"] < 5 and one["epe_px"] < 0.5
    mean = next(r for r in result["rows"] if r["pair"] is None and r["filled"])
    assert mean["d1_all_pct"] == one["d1_all_pct"]
    with pytest.raises(DataError):
        stereo_native.bench_native(tmp_path / "training" / "image_2", ["sgbm"])


def test_a_network_is_fed_its_size_and_its_answer_is_scaled():
    seen = []

    def match(left, right):
        seen.append(left.shape)
        return np.full((240, 320), 8.0, np.float32)

    blank = np.zeros((200, 640), np.uint8)
    found = stereo_native.enlarged(match)(blank, blank)
    assert seen == [(240, 320)]
    assert found.shape == (200, 640) and (found == 16.0).all()
    assert stereo_native.searched_px(640) == 128 and stereo_native.searched_px(450) == 96
