"""Textures: made from seeds, without seams, with something to match on most."""

import numpy as np
import pytest

from robot.errors import SceneError
from robot.sim.surfaces import noise
from robot.sim.textures import RECIPES, check_texture, make_texture, marker


@pytest.mark.parametrize("recipe", sorted(RECIPES))
def test_a_recipe_gives_a_grey_picture_that_its_seed_decides(recipe):
    first, second = make_texture(f"{recipe}:1"), make_texture(f"{recipe}:2")
    assert first.image.dtype == np.uint8 and first.image.ndim == 2
    assert not np.array_equal(first.image, second.image)
    make_texture.cache_clear()
    assert np.array_equal(first.image, make_texture(f"{recipe}:1").image)
    assert 5 < first.image.mean() < 235


@pytest.mark.parametrize("recipe", ["planks", "parquet", "tiles", "carpet", "brick", "fabric"])
def test_floors_have_detail_and_a_plain_wall_has_none(recipe):
    assert make_texture(recipe).image.std() > 5.0
    assert make_texture("plain").image.std() < 2.0


@pytest.mark.parametrize("recipe", ["carpet", "fabric", "wood", "plaster", "wallpaper", "leather"])
def test_repeats_meet_without_a_seam(recipe):
    image = make_texture(recipe).image.astype(float)
    for axis in (0, 1):
        step = np.abs(np.diff(image, axis=axis)).mean()
        seam = np.abs(image.take(0, axis) - image.take(-1, axis)).mean()
        assert seam < 2.5 * step + 1.0


def test_noise_is_normalised_and_smoother_for_a_larger_exponent():
    rng = np.random.default_rng(3)
    rough, smooth = noise(rng, 64, 128, 0.3), noise(rng, 64, 128, 1.8)
    for field in (rough, smooth):
        assert field.shape == (64, 128)
        assert field.mean() == pytest.approx(0.0, abs=1e-9)
        assert field.std() == pytest.approx(1.0)
    assert np.abs(np.diff(smooth)).mean() < 0.3 * np.abs(np.diff(rough)).mean()


@pytest.mark.parametrize(
    ("name", "said"), [("velvet", "velvet.*carpet"), ("wood:x", "wood:3"), ("wood:", "bad seed")]
)
def test_a_wrong_name_is_explained(name, said):
    with pytest.raises(SceneError, match=said):
        check_texture(name)


def test_the_marker_is_black_and_white_inside_a_white_margin():
    image = marker(7, 0.12).image
    margin = int(512 * 0.12 / 1.24) - 2
    assert (image[:margin] == 255).all() and (image[:, :margin] == 255).all()
    assert image[margin + 6, 256] == 0
    assert not np.array_equal(image, marker(8, 0.12).image)
