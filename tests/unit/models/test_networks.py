"""Shapes, arithmetic and fields of view of the networks."""

import pytest

torch = pytest.importorskip("torch")
from torch.nn import functional as F  # noqa: E402

from models.networks import NETWORKS, Exported, build, fold_norms  # noqa: E402
from models.networks.hybrid import (  # noqa: E402
    SHIFTS,
    BandConv3d,
    Evidence,
    Tower,
    correlation,
    look_up,
    soft_argmins,
)
from models.networks.hybrid_paper import (  # noqa: E402
    InterleavedConv3d,
    interleave,
    start_as_differences,
)


@pytest.fixture(autouse=True)
def _quiet():
    torch.manual_seed(0)
    torch.set_num_threads(1)


@pytest.mark.parametrize("name", sorted(NETWORKS))
def test_outputs_have_the_size_of_the_input(name):
    network = build(name).eval()
    eye = torch.randn(1, 1, 48, 64)
    with torch.no_grad():
        estimate = network(eye, eye)
        disparity, confidence = Exported(network)(eye, eye)
    assert estimate.disparity.shape == estimate.confidence.shape == (1, 1, 48, 64)
    assert all(c.shape == (1, 1, 48, 64) for c in estimate.coarse)
    assert not (disparity < 0).any()  # a gap is NaN
    assert ((confidence >= 0) & (confidence <= 1)).all()


@pytest.mark.parametrize("name", sorted(NETWORKS))
def test_folding_does_not_change_the_result(name):
    network = build(name)
    eyes = torch.randn(2, 2, 1, 48, 64)
    network(eyes[0], eyes[1])  # moves the running statistics away from their start
    network.eval()
    part = "logits" if name == "similarity" else "disparity"  # the best of 32 jumps
    with torch.no_grad():
        before = getattr(network(eyes[0], eyes[1]), part)
        after = getattr(fold_norms(network)(eyes[0], eyes[1]), part)
    torch.testing.assert_close(before, after, atol=2e-3, rtol=1e-3)
    assert not any(isinstance(m, torch.nn.BatchNorm2d) for m in network.modules())


@pytest.mark.parametrize("name", sorted(NETWORKS))
def test_every_weight_learns(name):
    network = build(name)
    estimate = network(torch.randn(2, 1, 48, 64), torch.randn(2, 1, 48, 64))
    total = estimate.disparity.sum() + estimate.confidence.sum()
    for earlier in (*estimate.coarse, estimate.surfaces, estimate.logits):
        total = total + (0 if earlier is None else earlier.sum())
    total.backward()
    idle = [n for n, p in network.named_parameters() if p.grad is None]
    assert idle == []


def test_features_are_interleaved_channel_by_channel():
    left = torch.arange(3.0).view(1, 3, 1, 1).expand(2, 3, 4, 5)
    stack = interleave(left, left + 10)
    assert stack.shape == (2, 6, 4, 5)
    assert stack[1, :, 2, 3].tolist() == [0, 10, 1, 11, 2, 12]


@pytest.mark.parametrize("dilation", [1, 2, 4])
def test_the_interleaved_convolution_is_a_3d_convolution(dilation):
    layer = InterleavedConv3d(5, dilation)
    stack = torch.randn(2, 6, 7, 40)
    padded = F.pad(stack, (15 * dilation, 0, 1, 1))[:, None]
    expected = F.conv3d(padded, layer.weight, layer.bias, (2, 1, 1), 0, (1, 1, dilation))
    expected = expected.transpose(1, 2).reshape(2, 15, 7, 40)  # kernels of a pair together
    torch.testing.assert_close(layer(stack), expected, atol=1e-5, rtol=1e-5)
    assert layer.weight.shape[2:] == (2, 3, 16)  # depth, height, width


@pytest.mark.parametrize("dilation", [1, 2, 4])
def test_a_kernel_looks_only_to_the_left_and_as_far_as_its_dilation_says(dilation):
    layer = InterleavedConv3d(2, dilation)
    torch.nn.init.ones_(layer.weight)
    width, at = 80, 70
    stack = torch.zeros(1, 2, 5, width)
    stack[0, 1, 2, :] = torch.arange(width) + 1000.0
    stack.requires_grad_()
    layer(stack)[0, 0, 2, at].backward()
    columns = stack.grad[0, 1, 2].nonzero()[:, 0].tolist()
    assert columns == [at - 15 * dilation + dilation * i for i in range(16)]
    rows = stack.grad[0, 1, :, at].nonzero()[:, 0].tolist()
    assert rows == [1, 2, 3]


def test_kernels_start_as_differences_at_every_shift():
    layer = InterleavedConv3d(16, 1)
    torch.nn.init.zeros_(layer.weight)
    start_as_differences(layer.weight)
    left, right = torch.randn(1, 1, 3, 30), torch.randn(1, 1, 3, 30)
    out = layer(interleave(left, right))
    for k in range(16):
        torch.testing.assert_close(out[0, k, 1, 20], left[0, 0, 1, 20] - right[0, 0, 1, 20 - k])


def test_band_convolution_is_a_3d_convolution_of_depth_stride_two():
    layer = BandConv3d(4)
    torch.nn.init.normal_(layer.bias)
    volume = torch.randn(3, 16, 6, 7)
    expected = F.conv3d(volume[:, None], layer.weight, layer.bias, (2, 1, 1), 1).relu()
    got = layer(volume).view(3, 8, 4, 6, 7).transpose(1, 2)
    torch.testing.assert_close(got, expected, atol=1e-5, rtol=1e-5)


@pytest.mark.parametrize("width", [40, 64, 80])
def test_correlation_compares_with_the_right_image_further_left(width):
    left, right = torch.randn(2, 4, 3, width), torch.randn(2, 4, 3, 2 * width)
    volume = correlation(left, right)
    assert volume.shape == (2, SHIFTS, 3, width)
    for x in (0, 7, width - 1):
        for shift in (0, 1, 9, 31):
            seen = 2 * x - shift
            expected = (left[1, :, 2, x] * right[1, :, 2, seen]).mean() if seen >= 0 else 0.0
            torch.testing.assert_close(volume[1, 31 - shift, 2, x], torch.as_tensor(expected))


def test_a_dense_tower_agrees_with_the_other_at_even_columns():
    tower = Tower(8, 16).eval()
    x = torch.randn(1, 8, 12, 24)
    for sparse, dense in zip(tower(x, dense=False), tower(x, dense=True), strict=True):
        assert dense.shape == (1, 16, 6, 24)
        torch.testing.assert_close(sparse, dense[..., ::2], atol=1e-5, rtol=1e-5)


def test_soft_argmins_are_expected_disparities_of_both_sets():
    logits = torch.randn(2, 2 * SHIFTS, 3, 4)
    cells = (torch.arange(SHIFTS) / 2.0).view(1, SHIFTS, 1, 1)
    for i, scores in enumerate(logits.chunk(2, 1)):
        expected = (scores.softmax(1) * cells).sum(1)
        torch.testing.assert_close(soft_argmins(logits)[:, i], expected, atol=1e-4, rtol=1e-4)


def test_looking_up_at_the_true_disparity_finds_the_same_thing():
    right = torch.randn(2, 4, 5, 40)
    left = torch.roll(right, 7, 3)
    found, rest = look_up(right, torch.full((2, 1, 5, 40), 7.3))
    torch.testing.assert_close(found.permute(0, 3, 1, 2)[..., 7:], left[..., 7:])
    torch.testing.assert_close(rest, torch.full((2, 1, 5, 40), 0.3))
    assert (found[:, :, :7] == found[:, :, :1]).all()  # held at the border


def test_evidence_begins_as_zero_difference_at_the_right_surface_and_not_at_the_wrong_one():
    evidence = Evidence(8)
    right = torch.randn(1, 8, 8, 40)
    left = torch.roll(right, 6, 3)
    torch.nn.init.ones_(evidence.weigh.weight[:, 4:8])
    torch.nn.init.zeros_(evidence.weigh.weight[:, :4])
    torch.nn.init.zeros_(evidence.weigh.weight[:, 8:])
    torch.nn.init.zeros_(evidence.weigh.bias)
    both = torch.tensor([3.0, 5.0]).view(1, 2, 1, 1).expand(1, 2, 4, 20)
    seen = evidence(left, right, both)[..., 8:-2]
    assert seen[:, 0].abs().max() < 1e-5
    assert seen[:, 4].mean() > 0.5
