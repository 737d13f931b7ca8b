"""The stereo bench on tiny folders in the layouts of the public data sets."""

import json

import cv2
import numpy as np
import pytest

from robot.bench.stereo.bench import StereoOrder, bench_stereo, run_order, tables
from robot.bench.stereo.matchers import make_matcher
from robot.bench.stereo.pairs import find_pairs, read_pfm, to_protocol
from robot.errors import DataError, ModelError

SHIFT = 16  # px in the source images


def textured(height, width, seed=0):
    rng = np.random.default_rng(seed)
    image = rng.integers(0, 256, (height, width + SHIFT), dtype=np.uint8)
    image = cv2.GaussianBlur(image, (0, 0), 1.5)
    image = cv2.normalize(image, None, 0, 255, cv2.NORM_MINMAX)
    return image[:, :width], image[:, SHIFT:]  # left(x) = right(x - SHIFT)


def write_pfm(path, values):
    height, width = values.shape
    with path.open("wb") as file:
        file.write(f"Pf\n{width} {height}\n-1.0\n".encode())
        file.write(values[::-1].astype("<f4").tobytes())


def middlebury(folder, height=120, width=200):
    folder.mkdir(parents=True)
    left, right = textured(height, width)
    cv2.imwrite(str(folder / "im0.png"), left)
    cv2.imwrite(str(folder / "im1.png"), right)
    truth = np.full((height, width), float(SHIFT), np.float32)
    truth[:10] = np.inf
    write_pfm(folder / "disp0.pfm", truth)
    mask = np.full((height, width), 255, np.uint8)
    mask[:, :80] = 128
    cv2.imwrite(str(folder / "mask0nocc.png"), mask)


def kitti(training, first, second, truth_name, height=120, width=400):
    left, right = textured(height, width, 1)
    truth = np.full((height, width), 256 * SHIFT, np.uint16)
    truth[:20] = 0
    truth[:, : 120 + SHIFT] = 0  # the crop starts at 120; then the right eye sees nothing
    for name, image in ((first, left), (second, right), (truth_name, truth)):
        (training / name).mkdir(parents=True)
        cv2.imwrite(str(training / name / "000007_10.png"), image)


@pytest.fixture
def pairs_dir(tmp_path):
    middlebury(tmp_path / "middlebury" / "wall")
    middlebury(tmp_path / "eth3d" / "hall")
    kitti(tmp_path / "kitti" / "training", "image_2", "image_3", "disp_noc_0")
    return tmp_path


def test_every_layout_is_found_and_scaled(pairs_dir):
    pairs = {p.name: p for p in find_pairs(pairs_dir)}
    assert {n: p.family for n, p in pairs.items()} == {
        "hall": "eth3d",
        "wall": "middlebury",
        "000007": "kitti2015",
    }
    for pair in pairs.values():
        assert pair.left.shape == pair.right.shape == pair.truth_px.shape == (240, 320)
        # 120 rows crop to 160 columns, which become 320: disparity doubles.
        assert np.nanmin(pair.truth_px) == np.nanmax(pair.truth_px) == 2 * SHIFT
    assert np.isnan(pairs["wall"].truth_px[:20]).all()
    assert not np.isnan(pairs["wall"].truth_px[20:]).any()
    assert not pairs["wall"].visible[:, :120].any()
    assert pairs["wall"].visible[:, 120:].all()
    assert not pairs["000007"].visible[:40].any()


def test_kitti_2012_and_occluded_truth(tmp_path):
    training = tmp_path / "training"
    kitti(training, "colored_0", "colored_1", "disp_noc")
    (training / "disp_occ").mkdir()
    whole = np.full((120, 400), 256 * SHIFT, np.uint16)
    cv2.imwrite(str(training / "disp_occ" / "000007_10.png"), whole)
    (pair,) = find_pairs(tmp_path)
    assert pair.family == "kitti2012"
    assert np.isfinite(pair.truth_px).all()
    assert not pair.visible[:40].any()


def test_bench_measures_a_constant_shift(pairs_dir, tmp_path):
    result = bench_stereo(pairs_dir, ["sgbm", "bm"], tmp_path / "out")
    json.dumps(result, allow_nan=False)
    assert result["size"] == [320, 240]
    rows = result["rows"]
    # 2 matchers x 2 masks x 2 fillings x (3 pairs + 3 families + indoor + all)
    assert len(rows) == 2 * 2 * 2 * 8
    filled = [r for r in rows if r["pair"] is None and r["mask"] == "noc" and r["filled"]]
    for row in filled:
        assert row["density_pct"] == 100.0
        assert row["bad1_pct"] < 5.0
        assert row["epe_px"] < 0.5
    printed = tables(result)["all, gaps filled"]
    assert [row["matcher"] for row in printed] == ["sgbm", "bm"]
    mean = next(r for r in filled if r["matcher"] == "sgbm" and r["family"] == "all")
    assert printed[0]["bad-2 noc"] == mean["bad2_pct"] and printed[0]["density"] < 100.0
    sgbm = next(r for r in rows if r["matcher"] == "sgbm" and r["family"] == "all")
    assert sgbm["ms_over_sgbm"] == 1.0 and sgbm["ms"] > 0 and sgbm["a53_minstr"] > 50
    assert len(list((tmp_path / "out").glob("*.png"))) == 3


def test_mean_rows_are_the_means_of_their_pairs(pairs_dir):
    rows = bench_stereo(pairs_dir, ["bm"])["rows"]
    chosen = [r for r in rows if r["mask"] == "all" and not r["filled"]]
    indoor = next(r for r in chosen if r["family"] == "indoor")
    single = [r["bad2_pct"] for r in chosen if r["pair"] in ("wall", "hall")]
    assert indoor["bad2_pct"] == pytest.approx(np.mean(single), abs=0.01)
    assert indoor["ms_over_sgbm"] is None


def test_the_padded_border_is_searched():
    left, right = textured(240, 320)
    found = make_matcher("sgbm").match(left, right)
    assert np.isfinite(found[:, SHIFT + 4 : 60]).mean() > 0.9
    assert np.nanmedian(found) == pytest.approx(SHIFT, abs=0.1)
    assert np.isnan(make_matcher("sgbm_example").match(left, right)[:, :60]).all()


def test_no_pairs_and_unknown_matchers_are_explained(tmp_path, pairs_dir):
    with pytest.raises(DataError, match="no stereo pair"):
        find_pairs(tmp_path / "kitti" / "training" / "image_2")
    with pytest.raises(DataError, match="no folder"):
        find_pairs(tmp_path / "nowhere")
    (tmp_path / "manifest.toml").write_text('default = "x"\n[[networks]]\nname = "x"\n')
    with pytest.raises(ModelError, match=r"'nonsense'.*use x, sgbm"):
        bench_stereo(pairs_dir, ["nonsense"], models=tmp_path)


def test_a_damaged_network_is_refused(tmp_path):
    (tmp_path / "x.onnx").write_bytes(b"damaged")
    entry = '[[networks]]\nname = "x"\nfile = "x.onnx"\nsha256 = "00"\n'
    (tmp_path / "manifest.toml").write_text(f'default = "x"\n{entry}')
    with pytest.raises(ModelError, match="sha256"):
        make_matcher("x", tmp_path)
    (tmp_path / "x.onnx").unlink()
    with pytest.raises(ModelError, match="missing"):
        make_matcher("x", tmp_path)
    (tmp_path / "manifest.toml").write_text("default = 3")
    with pytest.raises(ModelError, match="malformed"):
        make_matcher("x", tmp_path)


def test_a_file_that_is_no_pfm_is_named(tmp_path):
    path = tmp_path / "disp0.pfm"
    path.write_bytes(b"PNG and more")
    with pytest.raises(DataError, match=r"disp0\.pfm"):
        read_pfm(path)


def test_big_endian_pfm(tmp_path):
    path = tmp_path / "b.pfm"
    values = np.arange(6, dtype=">f4").reshape(2, 3)
    path.write_bytes(b"Pf\n3 2\n1.0\n" + values[::-1].tobytes())
    np.testing.assert_array_equal(read_pfm(path), values)


def test_a_tall_image_is_cropped_to_four_by_three():
    grey = np.zeros((100, 40), np.uint8)
    truth = np.repeat(np.arange(100, dtype=np.float32)[:, None], 40, 1)
    pair = to_protocol("tall", "middlebury", grey, grey, truth, np.ones((100, 40), bool))
    rows = pair.truth_px / 8  # 40 columns become 320
    assert rows.min() == 35 and rows.max() == 64


@pytest.mark.parametrize("way", ["native", "stress", "confidence"])
def test_every_way_of_the_command_line_gives_tables(pairs_dir, tmp_path, way):
    order = StereoOrder(pairs_dir / "eth3d", ["sgbm"], tmp_path / "out", way=way)
    found = tables(run_order(order))
    assert found
    assert all(row["matcher"] == "sgbm" for rows in found.values() for row in rows)


def test_error_panels_stand_beside_each_matcher(pairs_dir, tmp_path):
    run_order(StereoOrder(pairs_dir / "eth3d", ["bm"], tmp_path, error_panels=True))
    (path,) = tmp_path.glob("eth3d_*.png")
    assert cv2.imread(str(path)).shape == (240, 4 * 320, 3)  # left, truth, bm, its errors
