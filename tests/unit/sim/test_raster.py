"""The rasteriser on things whose picture can be computed by hand."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.sim.mesh import MeshBuilder
from robot.sim.renderer import Renderer, TextureAtlas

WIDTH, HEIGHT, FOCAL = 64, 48, 50.0
CX, CY = (WIDTH - 1) / 2, (HEIGHT - 1) / 2
UNIT_UV = np.array([[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]])


def facing(x0, x1, y0, y1, z):
    """A rectangle that looks back at an eye in the origin (camera axes: y down, z forward)."""
    return np.array([[x0, y1, z], [x1, y1, z], [x1, y0, z], [x0, y0, z]])


def draw(*faces, images=None, background=0.0, one_sided=True):
    builder = MeshBuilder()
    for k, corners in enumerate(faces):
        builder.add(corners, UNIT_UV, k, one_sided=one_sided)
    images = images or [np.full((4, 4), 100 + 100 * k, np.uint8) for k in range(len(faces))]
    renderer = Renderer(builder.build()[0], TextureAtlas.pack(images), WIDTH, HEIGHT)
    return renderer.render(np.eye(4), FOCAL, CX, CY, background)


def test_a_slanted_plane_has_the_depth_of_its_equation():
    """z = 2 + 0.5 x, so 1/z = (1 - 0.5 u) / 2 at ray slope u."""
    corners = np.array([[-3, 2, 0.5], [3, 2, 3.5], [3, -2, 3.5], [-3, -2, 0.5]], float)
    _, inverse_depth = draw(corners)
    slope = (np.arange(WIDTH) - CX) / FOCAL
    expected = np.broadcast_to((1.0 - 0.5 * slope) / 2.0, inverse_depth.shape)
    np.testing.assert_allclose(inverse_depth, expected, rtol=1e-6)


def test_the_nearer_face_hides_the_farther_in_whatever_order():
    near, far = facing(-0.2, 0.2, -0.2, 0.2, 1.0), facing(-9, 9, -9, 9, 3.0)
    grey = np.full((4, 4), 100, np.uint8), np.full((4, 4), 200, np.uint8)
    first, depth = draw(near, far, images=[grey[0], grey[1]])
    second, _ = draw(far, near, images=[grey[1], grey[0]])
    np.testing.assert_array_equal(first, second)
    assert first[24, 32] == 100 and first[2, 2] == 200
    assert depth[24, 32] == pytest.approx(1.0) and depth[2, 2] == pytest.approx(1 / 3)


def test_nothing_there_is_background_without_depth():
    grey, inverse_depth = draw(facing(-9, 9, -9, 9, -2.0), background=7.0)
    assert (grey == 7.0).all() and (inverse_depth == 0.0).all()


def test_a_one_sided_face_is_not_drawn_from_behind():
    behind = facing(-1, 1, -1, 1, 2.0)[::-1]
    assert (draw(behind)[0] == 0).all()
    assert (draw(behind, one_sided=False)[0] > 0).any()


def test_a_floor_under_the_eye_is_clipped_at_the_near_plane():
    """A floor 0.1 below reaches behind the eye; below the horizon all of it is seen."""
    floor = np.array([[-50, 0.1, -50], [-50, 0.1, 50], [50, 0.1, 50], [50, 0.1, -50]], float)
    _, inverse_depth = draw(floor, one_sided=False)
    rows = np.arange(30, HEIGHT)
    expected = (rows - CY) / FOCAL / 0.1
    np.testing.assert_allclose(inverse_depth[rows, 10], expected, rtol=1e-6)


@settings(max_examples=30, deadline=None)
@given(st.floats(-5.0, 5.0), st.sampled_from(["vertical", "horizontal"]))
def test_edges_fall_between_pixels(shift_px, direction):
    """The bright share of the picture tells where its edge is, to a small part of a pixel."""
    edge_m = shift_px / FOCAL
    corners = facing(-9, edge_m, -9, 9, 1.0) if direction == "vertical" else None
    corners = facing(-9, 9, -9, edge_m, 1.0) if corners is None else corners
    grey, _ = draw(corners)
    size, centre = (WIDTH, CX) if direction == "vertical" else (HEIGHT, CY)
    measured = grey.mean() / 100.0 * size - 0.5 - centre
    assert measured == pytest.approx(shift_px, abs=0.03 if direction == "vertical" else 0.14)


def test_a_fine_pattern_far_away_becomes_its_mean_not_noise():
    checker = (np.indices((1024, 1024)).sum(axis=0) % 2 * 200).astype(np.uint8)
    grey, _ = draw(facing(-40, 40, -40, 40, 6.0), images=[checker])
    assert np.ptp(grey[4:-4, 4:-4]) < 12 and grey.mean() == pytest.approx(100, abs=3)


def test_odd_pictures_are_resized_to_powers_of_two_and_keep_their_mean():
    image = np.random.default_rng(1).integers(0, 255, (37, 90)).astype(np.uint8)
    atlas = TextureAtlas.pack([image, np.full((1, 1), 9, np.uint8)])
    assert atlas.log2_size.tolist() == [[6, 5], [0, 0]]
    assert atlas.texels[-1] == 9
    smallest = atlas.texels[atlas.offsets[0, atlas.levels[0] - 1]]
    assert smallest == pytest.approx(image.mean(), abs=4)
