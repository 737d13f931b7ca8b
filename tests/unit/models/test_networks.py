"""Shapes, arithmetic and fields of view of the networks."""

import pytest

torch = pytest.importorskip("torch")
from torch.nn import functional as F  # noqa: E402

from models.networks import NETWORKS, Exported, build, fold_norms  # noqa: E402
from models.networks.hybrid import (  # noqa: E402
    BandConv3d,
    correlation,
    differences,
    soft_argmin,
    warp,
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
    assert (disparity >= 0).all()
    assert ((confidence >= 0) & (confidence <= 1)).all()


@pytest.mark.parametrize("name", sorted(NETWORKS))
def test_folding_does_not_change_the_result(name):
    network = build(name)
    eyes = torch.randn(2, 2, 1, 48, 64)
    network(eyes[0], eyes[1])  # moves the running statistics away from their start
    network.eval()
    with torch.no_grad():
        before = network(eyes[0], eyes[1]).disparity
        after = fold_norms(network)(eyes[0], eyes[1]).disparity
    torch.testing.assert_close(before, after, atol=2e-3, rtol=1e-3)
    assert not any(isinstance(m, torch.nn.BatchNorm2d) for m in network.modules())


@pytest.mark.parametrize("name", sorted(NETWORKS))
def test_every_weight_learns(name):
    network = build(name)
    estimate = network(torch.randn(2, 1, 48, 64), torch.randn(2, 1, 48, 64))
    total = estimate.disparity.sum() + estimate.confidence.sum()
    (total + sum(c.sum() for c in estimate.coarse)).backward()
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
    layer = BandConv3d(2, 4)
    volume = torch.randn(3, 2, 16, 6, 7)
    expected = F.conv3d(volume, layer.weight, None, (2, 1, 1), 1)
    got = layer(volume).view(3, 8, 4, 6, 7).transpose(1, 2)
    torch.testing.assert_close(got, expected, atol=1e-5, rtol=1e-5)


def test_correlation_compares_with_the_right_image_further_left():
    left, right = torch.randn(1, 4, 3, 20), torch.randn(1, 4, 3, 20)
    volume = correlation(left, right, 6, 2)
    assert volume.shape == (1, 2, 6, 3, 20)
    for shift in range(6):
        expected = (left[0, 2:, 1, 15] * right[0, 2:, 1, 15 - shift]).mean()
        torch.testing.assert_close(volume[0, 1, shift, 1, 15], expected)
    assert (volume[0, :, 5, :, :5] == 0).all()  # outside the right image


def test_soft_argmin_is_the_expected_index():
    logits = torch.randn(2, 16, 3, 4)
    expected = (logits.softmax(1) * torch.arange(16.0).view(1, 16, 1, 1)).sum(1, keepdim=True)
    torch.testing.assert_close(soft_argmin(logits), expected)


def test_warping_by_the_true_disparity_undoes_the_shift():
    right = torch.randn(1, 4, 5, 40)
    left = torch.roll(right, 7, 3)
    warped = warp(right, torch.full((1, 1, 5, 40), 7.0))
    torch.testing.assert_close(warped[..., 7:], left[..., 7:], atol=1e-4, rtol=1e-4)
    least = differences(left, warped)[..., 10:-2].argmin(1)
    assert (least == 2).all()  # the middle of the five fine shifts


def test_half_a_pixel_is_interpolated():
    ramp = torch.arange(20.0).view(1, 1, 1, 20).expand(1, 1, 4, 20)
    warped = warp(ramp, torch.full((1, 1, 4, 20), 2.5))
    torch.testing.assert_close(warped[0, 0, 1, 5:], ramp[0, 0, 1, 5:] - 2.5)
