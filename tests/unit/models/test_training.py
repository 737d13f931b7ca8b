"""Loss, batches, resuming: small and quick."""

import math

import cv2
import numpy as np
import pytest

torch = pytest.importorskip("torch")
from models.data.batches import Shards, augment, batch  # noqa: E402
from models.data.feed import feed  # noqa: E402
from models.data.shards import (  # noqa: E402
    decode_disparity,
    encode_disparity,
    make_shard,
    write_shard,
)
from models.loss import known, shift_loss, stereo_loss, true_surfaces  # noqa: E402
from models.networks.blocks import Estimate  # noqa: E402
from models.train import Order, Trainer  # noqa: E402


def fake_pair(rng):
    image = rng.integers(0, 256, (240, 336)).astype(np.float32)
    shift = int(rng.integers(1, 16))
    return [(image[:, :320], image[:, shift : shift + 320], np.full((240, 320), float(shift)))]


@pytest.fixture
def folder(tmp_path):
    images, disparities = make_shard(np.random.default_rng(0), fake_pair, 3)
    write_shard(tmp_path / "shapes-0-0000", images, disparities)
    return tmp_path


def test_unknown_and_distant_truth_does_not_count():
    truth = torch.tensor([[[[float("nan"), 0.0, 64.0, 63.0]]]])
    assert known(truth).flatten().tolist() == [False, False, False, True]


def test_a_perfect_estimate_costs_less_and_ignored_pixels_cost_nothing():
    truth = torch.full((1, 1, 8, 8), 12.0)
    truth[..., 4:] = float("nan")
    sure = torch.full_like(truth, 9.0)
    exact = torch.nan_to_num(truth, 50.0)

    def cost(disparity):
        return stereo_loss(Estimate(disparity, sure, (disparity,)), truth).item()

    assert cost(exact) < 0.01
    wild = exact.clone()
    wild[..., 4:] = 3.0
    assert cost(wild) == pytest.approx(cost(exact))
    assert cost(exact + 3) > 3


def test_surfaces_are_the_extremes_in_and_around_a_cell():
    truth = torch.full((1, 1, 8, 12), float("nan"))
    truth[..., :4] = 5.0
    truth[..., 1, 4] = 20.0  # one column beyond the first cell
    near_far, valid = true_surfaces(truth)
    assert near_far.shape == (1, 2, 2, 3)
    assert near_far[0, :, 0, 0].tolist() == [20.0, 5.0]
    assert near_far[0, :, 1, 0].tolist() == [5.0, 5.0]
    assert valid[0, 0].tolist() == [[True, True, False], [True, True, False]]


def test_shift_loss_is_least_at_the_two_shifts_around_the_truth():
    target = torch.full((1, 1, 1, 1), 10.0)  # 2.5 shifts of 4 px
    logits = torch.full((1, 16, 1, 1), -20.0)
    logits[0, 2:4] = 0.0
    valid = torch.ones_like(target, dtype=torch.bool)
    assert shift_loss(logits, target, valid).item() == pytest.approx(math.log(2), abs=1e-4)
    even = shift_loss(torch.zeros(1, 16, 1, 1), target, valid)
    assert even.item() == pytest.approx(math.log(16))
    assert shift_loss(logits, target, ~valid).item() == 0


def test_disparity_codes_keep_a_256th_of_a_pixel_and_the_unknown():
    disparity = np.array([[0.5, 63.123, np.nan, 300.0]])
    back = decode_disparity(encode_disparity(disparity))
    np.testing.assert_allclose(back[0, :2], [0.5, 63.123], atol=1 / 512)
    assert np.isnan(back[0, 2:]).all()


def test_batches_depend_only_on_seed_and_step(folder):
    kinds = [Shards(folder, "shapes"), Shards(folder, "rooms")]
    first, again, other = (batch(1, s, kinds, 2) for s in (5, 5, 6))
    np.testing.assert_array_equal(first[0], again[0])
    np.testing.assert_array_equal(first[1], again[1])
    assert not np.array_equal(first[0], other[0])
    assert first[0].shape == (2, 2, 192, 256) and first[1].shape == (2, 1, 192, 256)


def test_batches_made_ahead_are_the_same_and_processes_share_them_out(folder):
    kinds = [Shards(folder, "shapes")]
    inline = feed(1, kinds, 2, first=4)
    expected = [next(inline)[0] for _ in range(5)]
    ahead = feed(1, kinds, 2, first=4, loaders=2)
    second = feed(1, kinds, 2, first=5, every=2)
    for grey in expected:
        np.testing.assert_array_equal(next(ahead)[0], grey)
    for grey in expected[1::2]:
        np.testing.assert_array_equal(next(second)[0], grey)
    ahead.close()


def test_augmenting_treats_both_eyes_alike():
    images = np.repeat(np.random.default_rng(0).integers(0, 256, (1, 240, 320)), 2, 0)
    truth = np.arange(240 * 320, dtype=np.float32).reshape(240, 320)
    for seed in range(8):
        grey, cut = augment(np.random.default_rng(seed), images, truth)
        np.testing.assert_array_equal(grey[0], grey[1])
        assert grey.shape == (2, 192, 256) and cut.shape == (192, 256)
        assert grey.min() >= 0 and grey.max() <= 255


def test_a_resized_window_still_matches_by_its_disparity():
    pixel = np.random.default_rng(0).normal(size=(240, 400))
    scene = np.clip(cv2.GaussianBlur(pixel, (0, 0), 4.0) * 600 + 128, 0, 255)
    images = np.stack([scene[:, 20:340], scene[:, 28:348]])  # right(x - 8) = left(x)
    seen = set()
    for seed in range(12):
        grey, truth = augment(np.random.default_rng(seed), images, np.full((240, 320), 8.0))
        disparity = truth[0, 0]
        seen.add(float(disparity))
        column = np.arange(20, 256)
        right = np.stack([np.interp(column - disparity, np.arange(256), row) for row in grey[1]])
        assert np.median(np.abs(right - grey[0][:, 20:])) < 2.0
    assert 8.0 in seen and min(seen) < 8.0 < max(seen)


def test_training_lowers_the_loss_saves_and_resumes(folder):
    order = Order("hybrid", 0.2, folder, folder, folder / "out", batch=2)
    torch.set_num_threads(1)
    trainer = Trainer(order)
    kinds = [Shards(folder, "shapes")]
    batches = trainer.batches(kinds)
    losses = [trainer.learn(*next(batches)) for _ in range(16)]
    assert np.mean(losses[-4:]) < np.mean(losses[:4])
    measured = trainer.check()
    assert {"shapes_epe_px", "shapes_bad1_pct", "shapes_bad3_pct"} <= set(measured)
    resumed = Trainer(order)
    assert resumed.step == 16 and resumed.best == trainer.best
    for part in ("network", "average"):
        old, new = (getattr(t, part).state_dict() for t in (trainer, resumed))
        assert all(torch.equal(old[k], new[k]) for k in old)
    assert (folder / "out" / "hybrid" / "best.pt").exists()


def test_the_rate_ends_near_zero(folder):
    trainer = Trainer(Order("hybrid", 1.0, folder, folder, folder / "out"))
    trainer.step, trainer.trained_s = 1000, 30.0
    assert trainer.rate() == pytest.approx(1.5e-3, rel=0.02)
    trainer.trained_s = 60.0
    assert trainer.rate() == pytest.approx(1e-5)
