"""Rendered pairs: the disparity is exact, the photometry leaves it alone."""

import cv2
import numpy as np
import pytest

from models.data import textures
from models.data.photometry import photograph
from models.data.shapes import shapes_pair

X, Y = np.meshgrid(np.arange(320, dtype=np.float32), np.arange(240, dtype=np.float32))


@pytest.fixture(scope="module")
def bank():
    return textures.bank(3, 8)


def agreement(left, right, disparity):
    """Median difference between the left image and the right one taken back, and unshifted."""
    known = np.isfinite(disparity)
    back = cv2.remap(right, X - np.nan_to_num(disparity), Y, cv2.INTER_LINEAR)
    inside = known & (X - np.nan_to_num(disparity) > 0)
    return np.median(np.abs(back - left)[inside]), np.median(np.abs(right - left)[inside])


def test_the_bank_is_reproducible_and_varied(bank):
    assert bank.shape == (8, 512, 512) and bank.dtype == np.uint8
    np.testing.assert_array_equal(bank, textures.bank(3, 8))
    assert len({image.tobytes() for image in bank}) == 8


def test_pictures_of_a_folder_join_the_bank(tmp_path):
    checks = np.kron(np.indices((32, 32)).sum(0) % 2, np.ones((20, 20))) * 255
    cv2.imwrite(str(tmp_path / "checks.png"), checks)
    cv2.imwrite(str(tmp_path / "checks_norm.png"), 255 - checks)
    cv2.imwrite(str(tmp_path / "flat.png"), np.full((640, 640), 90, np.uint8))
    found = textures.from_folder(tmp_path, 9, np.random.default_rng(0))
    assert len(found) == 1 and found[0].shape == (512, 512)


def test_shapes_have_exact_disparity(bank):
    for seed in range(4):
        rng = np.random.default_rng(seed)
        left, right, disparity = shapes_pair(rng, bank)
        assert left.shape == right.shape == disparity.shape == (240, 320)
        assert disparity.min() >= 0.2 and disparity.max() <= 63
        back, unshifted = agreement(left, right, disparity)
        assert back < 4.0 and back < 0.7 * unshifted + 1.0


def test_rooms_have_exact_disparity(bank):
    pytest.importorskip("numba")
    from models.data.rooms import RoomRenderer

    renderer = RoomRenderer(bank)
    pairs = [p for seed in range(4) for p in renderer.pairs(np.random.default_rng(seed))]
    assert len(pairs) >= 4
    for left, right, disparity in pairs:
        back, unshifted = agreement(left, right, disparity)
        assert back < 10 and back <= unshifted + 1


def test_room_pairs_repeat_with_the_seed(bank):
    pytest.importorskip("numba")
    from models.data.rooms import RoomRenderer

    renderer = RoomRenderer(bank)
    first, second = (renderer.pairs(np.random.default_rng(9)) for _ in range(2))
    for a, b in zip(first, second, strict=True):
        for x, y in zip(a, b, strict=True):
            np.testing.assert_array_equal(x, y)


def test_photographs_differ_between_the_eyes_but_stay_in_place():
    scene = cv2.GaussianBlur(
        np.random.default_rng(0).uniform(0, 255, (240, 320)).astype(np.float32), (0, 0), 4
    )
    scene = cv2.normalize(scene, None, 30, 220, cv2.NORM_MINMAX)
    differing = 0
    for seed in range(10):
        left, right = photograph(np.random.default_rng(seed), scene, scene)
        assert left.dtype == right.dtype == np.uint8
        differing += not np.array_equal(left, right)
        (dx, _), _ = cv2.phaseCorrelate(left.astype(np.float32), right.astype(np.float32))
        assert abs(dx) < 0.25
    assert differing == 10
