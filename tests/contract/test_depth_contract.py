"""What every matcher promises, whatever is inside it."""

from pathlib import Path

import cv2
import numpy as np
import pytest

import models
from robot.config import Config, PerceptionConfig
from robot.errors import FrameError, ModelError
from robot.geometry.stereo import StereoCamera, base_from_cam
from robot.perception.depth import make_depth

CAMERA = Config().camera.stereo_camera()
MATCHERS = ("sgbm", "onnx", "given")
SHIFTS_PX = (6, 20)  # of the background and of a square in front of it


def network() -> bytes:
    """The smallest network of the repository."""
    files = sorted(
        Path(models.__path__[0]).glob("artifacts/*.onnx"), key=lambda f: f.stat().st_size
    )
    return files[0].read_bytes()


@pytest.fixture(scope="module")
def pair() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A textured square before a textured background, and its exact disparity."""
    rng = np.random.default_rng(4)
    shape = (CAMERA.height_px, CAMERA.width_px + 64)
    layers = []
    for _ in SHIFTS_PX:
        noise = rng.standard_normal(shape).astype(np.float32)
        fine, coarse = (cv2.GaussianBlur(noise, (0, 0), s) for s in (1.0, 4.0))
        layers.append(128 + 25 * fine / fine.std() + 25 * coarse / coarse.std())
    back, front = layers
    left, right = back[:, :320].copy(), back[:, SHIFTS_PX[0] : 320 + SHIFTS_PX[0]].copy()
    rows, columns = slice(60, 180), slice(110, 230)
    left[rows, columns] = front[rows, columns]
    right[rows, 110 - SHIFTS_PX[1] : 230 - SHIFTS_PX[1]] = front[rows, columns]
    disparity = np.full(left.shape, float(SHIFTS_PX[0]), np.float32)
    disparity[rows, columns] = SHIFTS_PX[1]
    return _grey(left), _grey(right), disparity


def _grey(image: np.ndarray) -> np.ndarray:
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def depth_of(matcher: str, camera: StereoCamera = CAMERA):
    return make_depth(
        PerceptionConfig(matcher=matcher), camera, network() if matcher == "onnx" else None
    )


@pytest.mark.parametrize("matcher", MATCHERS)
def test_shape_type_and_range(matcher, pair):
    left, right, given = pair
    found = depth_of(matcher).match(left, right, t_ns=77, given=given)
    assert found.t_ns == 77
    for values in (found.disparity_px, found.confidence):
        assert values.shape == left.shape and values.dtype == np.float32
    known = np.isfinite(found.disparity_px)
    assert np.all(found.disparity_px[known] > 0)
    assert np.all(found.disparity_px[known] <= 64)
    assert np.all((found.confidence >= 0) & (found.confidence <= 1))
    assert not found.confidence[~known].any()


@pytest.mark.parametrize(("matcher", "share"), [("sgbm", 0.97), ("onnx", 0.7), ("given", 1.0)])
def test_it_matches(matcher, share, pair):
    left, right, truth = pair
    found = depth_of(matcher).match(left, right, given=truth)
    inner = np.zeros(left.shape, bool)
    inner[8:-8, 40:-8] = True
    inner &= cv2.erode((truth == 20).astype(np.uint8), np.ones((15, 15))).astype(bool) | (
        truth == 6
    )
    inner[50:190, 85:240] &= (truth == 20)[50:190, 85:240]  # the half-seen rim of the square
    trusted = inner & (found.confidence >= 0.5)
    assert np.count_nonzero(trusted) > 0.5 * np.count_nonzero(inner)
    wrong = np.abs(found.disparity_px[trusted] - truth[trusted])
    assert np.mean(wrong < 1.5) >= share


@pytest.mark.parametrize("matcher", MATCHERS)
def test_the_same_pair_gives_the_same_bits_and_is_left_alone(matcher, pair):
    left, right, given = pair
    copies = left.copy(), right.copy(), given.copy()
    depth = depth_of(matcher)
    first = depth.match(left, right, given=given)
    depth.match(right, left, given=given)  # a frame between leaves no trace
    again = depth.match(left, right, given=given)
    other = depth_of(matcher).match(left, right, given=given)
    for found in (again, other):
        np.testing.assert_array_equal(first.disparity_px, found.disparity_px)
        np.testing.assert_array_equal(first.confidence, found.confidence)
    for image, copy in zip((left, right, given), copies, strict=True):
        np.testing.assert_array_equal(image, copy)


@pytest.mark.parametrize("matcher", MATCHERS)
@pytest.mark.parametrize("wrong", ["left", "right"])
def test_an_image_of_another_kind_is_refused(matcher, wrong, pair):
    left, right, given = pair
    depth = depth_of(matcher)
    for bad in (left[::2, ::2].copy(), left.astype(np.float32), np.dstack([left] * 3)):
        images = {"left": left, "right": right} | {wrong: bad}
        with pytest.raises(FrameError, match=f"the {wrong} image is"):
            depth.match(images["left"], images["right"], given=given)


@pytest.mark.parametrize("matcher", MATCHERS)
def test_blank_images_do_not_crash(matcher, pair):
    blank = np.zeros_like(pair[0])
    found = depth_of(matcher).match(blank, blank, given=np.full(blank.shape, np.nan, np.float32))
    assert found.disparity_px.shape == blank.shape


def test_given_needs_what_it_is_to_give(pair):
    with pytest.raises(FrameError, match="without true disparity"):
        depth_of("given").match(pair[0], pair[1])


def test_sgbm_reaches_the_left_border(pair):
    left, right, _ = pair
    found = depth_of("sgbm").match(left, right)
    assert np.mean(np.isfinite(found.disparity_px[:, 8:64])) > 0.9


def test_sgbm_leaves_rows_unknown_that_nobody_needs(pair):
    left, right, _ = pair
    whole, part = (make_depth(PerceptionConfig(matcher="sgbm"), CAMERA, rows=n) for n in (None, 80))
    all_rows, few = whole.match(left, right), part.match(left, right)
    assert few.disparity_px.shape == all_rows.disparity_px.shape
    assert not np.isfinite(few.disparity_px[80:]).any() and not few.confidence[80:].any()
    known = np.isfinite(few.disparity_px[:80])
    assert known.mean() > 0.9 * np.isfinite(all_rows.disparity_px[:80]).mean() > 0.0


# ---------------------------------------------------------------- networks that do not fit


def other_camera() -> StereoCamera:
    return StereoCamera(160, 120, 114.0, 79.5, 59.5, 0.06, base_from_cam(0.13, 0.03, 0.09))


def test_a_network_for_another_size_is_refused():
    with pytest.raises(ModelError, match=r"input '(left|right)'.*160x120 px"):
        depth_of("onnx", other_camera())


@pytest.mark.parametrize("model", [b"", b"not a network", network()[:5000]])
def test_a_damaged_network_is_refused(model):
    with pytest.raises(ModelError, match="cannot be loaded") as caught:
        make_depth(PerceptionConfig(matcher="onnx"), CAMERA, model)
    assert "\n" not in str(caught.value)


def test_a_missing_network_is_refused():
    with pytest.raises(ModelError, match=r"perception\.model"):
        make_depth(PerceptionConfig(matcher="onnx"), CAMERA, None)


@pytest.mark.parametrize(
    ("inputs", "output", "says"),
    [
        (("image",), "disparity", "inputs are image"),
        (("left", "right"), "depth", "outputs are depth"),
    ],
)
def test_a_network_with_another_interface_is_refused(inputs, output, says):
    with pytest.raises(ModelError, match=says):
        make_depth(PerceptionConfig(matcher="onnx"), CAMERA, tiny_network(inputs, output))


def test_a_network_of_any_size_works_if_its_answer_fits():
    depth = make_depth(
        PerceptionConfig(matcher="onnx"),
        other_camera(),
        tiny_network(("left", "right"), "disparity"),
    )
    left = np.full((120, 160), 255, np.uint8)
    right = np.full((120, 160), 0, np.uint8)
    found = depth.match(left, right)
    # The tiny network adds its inputs: (255 - 128) / 64 + (0 - 128) / 64 is below 0, hence unknown.
    assert np.isnan(found.disparity_px).all()
    np.testing.assert_allclose(depth.match(left, left).disparity_px, 2 * 127 / 64)


def tiny_network(inputs: tuple[str, ...], output: str) -> bytes:
    """An ONNX file that adds its inputs (one input: to itself), written by hand.

    Field numbers are those of onnx.proto; shapes are left open.
    """
    names = (inputs * 2)[:2]
    dims = b"".join(_field(1, _field(2, axis.encode())) for axis in "nchw")
    tensor = _field(1, _number(1, 1) + _field(2, dims))  # float, open shape

    def value(name: str) -> bytes:
        return _field(1, name.encode()) + _field(2, tensor)

    node = b"".join(_field(1, name.encode()) for name in names)
    node += _field(2, output.encode()) + _field(4, b"Add")
    graph = _field(1, node) + _field(2, b"tiny")
    graph += b"".join(_field(11, value(name)) for name in inputs) + _field(12, value(output))
    return _number(1, 8) + _field(7, graph) + _field(8, _field(1, b"") + _number(2, 13))


def _varint(value: int) -> bytes:
    out = b""
    while value > 127:
        out, value = out + bytes([value & 127 | 128]), value >> 7
    return out + bytes([value])


def _field(number: int, content: bytes) -> bytes:
    return _varint(number << 3 | 2) + _varint(len(content)) + content


def _number(number: int, value: int) -> bytes:
    return _varint(number << 3) + _varint(value)
