"""Loaders of public data sets, on tiny folders in their layouts."""

import cv2
import numpy as np
import pytest

from models.data import real
from models.data.batches import Shards, batch
from robot.bench.stereo.pairs import as_it_is


def write_pfm(path, values):
    height, width = values.shape
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file:
        file.write(f"Pf\n{width} {height}\n-1.0\n".encode())
        file.write(values[::-1].astype("<f4").tobytes())


def picture(path, height, width, seed=0):
    path.parent.mkdir(parents=True, exist_ok=True)
    grey = np.random.default_rng(seed).integers(0, 256, (height, width), dtype=np.uint8)
    cv2.imwrite(str(path), grey)
    return grey


@pytest.fixture
def folder(tmp_path):
    scene = "TRAIN/A/0000"
    for side in ("left", "right"):
        picture(tmp_path / "flying/frames_cleanpass" / scene / side / "0006.png", 300, 600)
    truth = np.full((300, 600), -30.0, np.float32)  # some releases count to the left
    truth[:, 300:] = -60.0
    write_pfm(tmp_path / "flying/disparity" / scene / "left" / "0006.pfm", truth)
    picture(tmp_path / "flying/frames_cleanpass" / scene / "left" / "0007.png", 300, 600)
    for name in ("im0.png", "im1.png"):
        picture(tmp_path / "eth3d/hall" / name, 240, 320)
    write_pfm(tmp_path / "eth3d/hall/disp0GT.pfm", np.full((240, 320), 9.0, np.float32))
    for name in ("image_2", "image_3"):
        picture(tmp_path / "kitti/training" / name / "000001_10.png", 375, 1242)
    sparse = np.zeros((375, 1242), np.uint16)
    sparse[200:] = 256 * 40
    (tmp_path / "kitti/training/disp_noc_0").mkdir()
    cv2.imwrite(str(tmp_path / "kitti/training/disp_noc_0/000001_10.png"), sparse)
    return tmp_path


def test_every_layout_is_found_and_a_frame_without_truth_is_not(folder):
    found = {p.family: p for p in real.any_pairs(folder)}
    assert sorted(found) == ["eth3d", "kitti2015", "sceneflow"]
    assert found["sceneflow"].truth_px[0, 0] == 30 and found["sceneflow"].truth_px[0, 599] == 60
    assert found["kitti2015"].left.shape == (375, 1242)


def test_a_window_scales_disparities_with_its_width(folder):
    pair = next(p for p in real.any_pairs(folder) if p.family == "sceneflow")
    for seed in range(5):
        left, right, truth = real.window(np.random.default_rng(seed), pair)
        assert left.shape == right.shape == truth.shape == (240, 320)
        wide = 320 * 30 / truth.min()
        assert 199 <= wide <= 401


def test_the_paper_crops_the_lower_two_thirds(folder):
    kitti = next(p for p in real.any_pairs(folder) if p.family == "kitti2015")
    rows = np.broadcast_to(np.arange(375.0)[:, None], (375, 1242))
    pair = as_it_is("rows", "kitti2015", kitti.left, kitti.right, rows, rows >= 0)
    tops = []
    for seed in range(20):
        left, _, truth = real.paper_crop(np.random.default_rng(seed), pair)
        assert left.shape == (256, 512)
        tops.append(truth[0, 0])
    assert min(tops) >= 119 and max(tops) <= 125  # 375 - 256, as two thirds are 250 rows only
    small = as_it_is("small", "eth3d", *(np.zeros((100, 90)),) * 4)
    assert real.paper_crop(np.random.default_rng(0), small) is None


@pytest.mark.parametrize("paper", [False, True])
def test_shards_of_windows_can_be_trained_on(folder, tmp_path, paper):
    out = tmp_path / "out"
    found = real.views(np.random.default_rng(0), folder, 3, paper)
    count = real.write_shards(out, 1, found, 4)
    assert count == (6 if paper else 9)  # ETH3D's picture is too small for the paper's crop
    shards = Shards(out, "real")
    assert sum(len(i) for i in shards.images.values()) == count
    grey, truth = batch(0, 0, [shards], 2)
    assert grey.shape == (2, 2, 192, 256) and np.isfinite(truth).any()
