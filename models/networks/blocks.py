"""Bricks that both networks share. Feature maps are (batch, channels, h, w)."""

from __future__ import annotations

from typing import Any, NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional as F
from torch.nn.utils.fusion import fuse_conv_bn_weights

INPUT_MEAN, INPUT_SCALE = 128.0, 64.0  # grey 0..255 -> (grey - 128) / 64
MAX_DISPARITY = 64


class Estimate(NamedTuple):
    """What a network says. Disparities are (b, 1, h, w) px at input size, >= 0.

    `confidence` is a logit, (b, 1, h, w). The rest is for the loss only: `coarse` holds earlier
    guesses, upsampled; `logits` (b, n, h/k, w/k) scores of n shifts, 64 / n px apart; `surfaces`
    (b, 2, h/4, w/4) the near and the far disparity of each cell in px, and then `logits` has n
    scores for either of them.
    """

    disparity: Tensor
    confidence: Tensor
    coarse: tuple[Tensor, ...] = ()
    surfaces: Tensor | None = None
    logits: Tensor | None = None


class ConvNorm(nn.Module):
    """A convolution with batch normalisation, and ReLU unless `act` is false.

    `conv` may be any module with `weight` (outputs first) and `bias`; `fold` melts the
    normalisation into it, exactly, for inference.
    """

    def __init__(self, conv: nn.Module, outputs: int, act: bool = True) -> None:
        super().__init__()
        self.conv = conv
        self.norm: nn.Module = nn.BatchNorm2d(outputs)
        self.act: nn.Module = nn.ReLU(inplace=True) if act else nn.Identity()

    def forward(self, x: Tensor) -> Tensor:
        return self.act(self.norm(self.conv(x)))

    def fold(self) -> None:
        """Replace convolution and normalisation by one convolution with bias (eval mode only)."""
        n: Any = self.norm
        if isinstance(n, nn.Identity):
            return
        c: Any = self.conv
        c.weight, c.bias = fuse_conv_bn_weights(
            c.weight, c.bias, n.running_mean, n.running_var, n.eps, n.weight, n.bias
        )
        self.norm = nn.Identity()


def fold_norms(network: nn.Module) -> nn.Module:
    """Fold every batch normalisation of a network in eval mode; returns the same network."""
    for module in list(network.modules()):
        if isinstance(module, ConvNorm):
            module.fold()
    return network


def conv(
    inputs: int,
    outputs: int,
    kernel: int = 3,
    stride: int = 1,
    dilation: int = 1,
    groups: int = 1,
    act: bool = True,
) -> ConvNorm:
    """Convolution of odd kernel that keeps the size (or divides it by `stride`), normalised."""
    pad = kernel // 2 * dilation
    layer = nn.Conv2d(inputs, outputs, kernel, stride, pad, dilation, groups, bias=False)
    return ConvNorm(layer, outputs, act)


class Residual(nn.Module):
    """x + two 3x3 convolutions (He et al., CVPR 2016)."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.body = nn.Sequential(conv(channels, channels), conv(channels, channels, act=False))

    def forward(self, x: Tensor) -> Tensor:
        return F.relu(x + self.body(x))


class InvertedResidual(nn.Module):
    """x + (1x1 widen, 3x3 depthwise, 1x1 narrow) (Sandler et al., CVPR 2018)."""

    def __init__(self, channels: int, expand: int, dilation: int = 1) -> None:
        super().__init__()
        wide = channels * expand
        self.body = nn.Sequential(
            conv(channels, wide, 1),
            conv(wide, wide, 3, dilation=dilation, groups=wide),
            conv(wide, channels, 1, act=False),
        )

    def forward(self, x: Tensor) -> Tensor:
        return x + self.body(x)


class Separable(nn.Module):
    """x + (3x3 depthwise, 1x1), then ReLU: the cheapest way to look around."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.body = nn.Sequential(
            conv(channels, channels, 3, groups=channels), conv(channels, channels, 1, act=False)
        )

    def forward(self, x: Tensor) -> Tensor:
        return F.relu(x + self.body(x))


class Context(nn.Module):
    """Look far around at half the resolution: down, dilated inverted residuals, up, add, clean."""

    def __init__(
        self, inputs: int, wide: int, outputs: int, dilations: tuple[int, ...], expand: int
    ) -> None:
        super().__init__()
        self.down = conv(inputs, wide, 3, 2)
        self.blocks = nn.Sequential(*(InvertedResidual(wide, expand, d) for d in dilations))
        self.up = nn.Conv2d(wide, outputs, 1)
        self.skip = nn.Conv2d(inputs, outputs, 1)
        self.clean = Separable(outputs)

    def forward(self, x: Tensor) -> Tensor:
        far = F.interpolate(self.up(self.blocks(self.down(x))), scale_factor=2.0, mode="nearest")
        return self.clean(F.relu(self.skip(x) + far))


class Head(nn.Module):
    """From features at 1/4 and a base disparity there to disparity and confidence at full size.

    One 1x1 convolution gives a correction of the base, 16 corrections for the 4x4 pixels of the
    cell (placed by depth-to-space), and the confidence.
    """

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.out = nn.Conv2d(channels, 18, 1)

    def forward(self, x: Tensor, base: Tensor) -> tuple[Tensor, Tensor]:
        y = self.out(x).float()
        cell = enlarge(base + y[:, :1], 4) * 4
        pixel = F.pixel_shuffle(y[:, 1:17], 4)
        return F.relu(cell + pixel), enlarge(y[:, 17:], 4)


def enlarge(x: Tensor, factor: int) -> Tensor:
    """Bilinear upsampling; values stay as they are."""
    return F.interpolate(x, scale_factor=float(factor), mode="bilinear", align_corners=False)


class Exported(nn.Module):
    """The runtime's contract: (left, right) -> (disparity px, confidence 0..1)."""

    def __init__(self, network: nn.Module) -> None:
        super().__init__()
        self.network = network

    def forward(self, left: Tensor, right: Tensor) -> tuple[Tensor, Tensor]:
        estimate = self.network(left, right)
        return estimate.disparity, torch.sigmoid(estimate.confidence)
