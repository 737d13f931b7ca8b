"""`hybrid_paper`: 2-D towers, one layer of dilated 3-D convolutions, 2-D regression.

For an input of 240x320 grey pixels, layer by layer (k = kernel, s = stride, ch = channels):

| layer | k, s | ch | size | why |
|---|---|---|---|---|
| stem 1 | 5x5, 2 | 8 | 120x160 | strided convolution instead of pooling |
| stem 2 | 3x3, 2 | 16 | 60x80 | matching at 1/4 keeps 64 px within one kernel of width 16 |
| residual block | 2 x 3x3 | 16 | 60x80 | the tower; its weights are shared by both eyes |
| features | 3x3, linear | 8 | 60x80 | signed, so that differences mean something |
| interleave | | 16 | 60x80 | L1 R1 L2 R2 ... L8 R8: the depth axis of the 3-D convolution |
| 3-D conv | 16x3x2 (w, h, d), depth stride 2, dilation 1 | 16 per pair | 60x80 | reaches 0..60 px |
| 3-D conv | the same, dilation 2 | 4 per pair | 60x80 | twice as far, every second column |
| 3-D conv | the same, dilation 4 | 4 per pair | 60x80 | the whole width of the image |
| concatenate, merge | 1x1 | 48 | 60x80 | over 8 pairs x 24 kernels = 192 channels |
| context | 3x3 s 2, 4 dilated inverted residuals, nearest x2, skip | 48 | 30x40 | regression |
| regression | 1x1 | 1 | 60x80 | softplus: a disparity is not negative |
| head | 1x1 | 18 | 240x320 | bilinear x4 + depth-to-space residual; confidence |

Our choices where such a network leaves them open: the number of channels and kernels, matching at
1/4, the three dilations, and the kernels' window, which ends at the left pixel's own column and
looks only to the left, because a match in the right image never lies to the right. As the depth
stride equals the kernel's depth, each step sees exactly one pair (Lk, Rk): the 3-D convolution is
computed as a 2-D convolution of two channels per pair with shared weights, the same arithmetic.
The kernels of dilation 1 start as "left minus right k columns away" and half of the features as
the negatives of the other half, so that the sum over features starts as an absolute difference.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from models.networks.blocks import Context, ConvNorm, Estimate, Head, Residual, conv, enlarge

WIDTH, HEIGHT, DEPTH = 16, 3, 2  # of the 3-D kernel


def interleave(left: Tensor, right: Tensor) -> Tensor:
    """(b, c, h, w) twice -> (b, 2c, h, w) in the order L1 R1 L2 R2 ..."""
    batch, channels, height, width = left.shape
    return torch.stack([left, right], 2).view(batch, 2 * channels, height, width)


class InterleavedConv3d(nn.Module):
    """3-D convolution, kernel 16x3x2 (w, h, d), depth stride 2, over an interleaved stack.

    Input (b, 2c, h, w), output (b, c * kernels, h, w) with the kernels of one pair together.
    `weight` is (kernels, 1, 2, 3, 16) as in Conv3d; dilation is along the width only.
    """

    def __init__(self, kernels: int, dilation: int) -> None:
        super().__init__()
        self.kernels, self.dilation = kernels, dilation
        self.weight = nn.Parameter(0.1 * torch.randn(kernels, 1, DEPTH, HEIGHT, WIDTH))
        self.bias: nn.Parameter | None = nn.Parameter(torch.zeros(kernels))
        if kernels == WIDTH and dilation == 1:
            start_as_differences(self.weight)

    def forward(self, stack: Tensor) -> Tensor:
        batch, channels, height, width = stack.shape
        pairs = stack.reshape(batch * channels // DEPTH, DEPTH, height, width)
        span = (WIDTH - 1) * self.dilation
        padded = F.pad(pairs, (span, 0, 1, 1))
        weight = self.weight.reshape(self.kernels, DEPTH, HEIGHT, WIDTH)
        out = F.conv2d(padded, weight, self.bias, dilation=(1, self.dilation))
        return out.reshape(batch, channels // DEPTH * self.kernels, height, width)


def start_as_differences(weight: Tensor) -> None:
    """Kernel k begins as left(x) - right(x - k), plus a little noise."""
    with torch.no_grad():
        weight.mul_(0.2)
        for k in range(WIDTH):
            weight[k, 0, 0, HEIGHT // 2, WIDTH - 1] += 1.0
            weight[k, 0, 1, HEIGHT // 2, WIDTH - 1 - k] -= 1.0


def start_as_opposites(layer: nn.Conv2d) -> None:
    """The second half of the outputs begins as the negative of the first."""
    with torch.no_grad():
        half = layer.out_channels // 2
        layer.weight[half:] = -layer.weight[:half]
        layer.bias.zero_()  # type: ignore[union-attr]


class HybridPaper(nn.Module):
    """See the table at the top of the file."""

    def __init__(self, features: int = 8, wide: int = 48) -> None:
        super().__init__()
        last = nn.Conv2d(16, features, 3, 1, 1)
        start_as_opposites(last)
        self.tower = nn.Sequential(conv(1, 8, 5, 2), conv(8, 16, 3, 2), Residual(16), last)
        self.match = nn.ModuleList(
            InterleavedConv3d(kernels, dilation) for kernels, dilation in ((16, 1), (4, 2), (4, 4))
        )
        self.merge: ConvNorm = conv(features * 24, wide, 1)
        self.context = Context(wide, wide, wide, (1, 2, 4, 1), 3)
        self.regress = nn.Conv2d(wide, 1, 1)
        self.head = Head(wide)

    def forward(self, left: Tensor, right: Tensor) -> Estimate:
        both = self.tower(torch.cat([left, right], 0))
        stack = interleave(*both.chunk(2, 0))
        matched = torch.cat([F.relu(layer(stack)) for layer in self.match], 1)
        x = self.context(self.merge(matched))
        base = 4 * F.softplus(self.regress(x).float())
        disparity, confidence = self.head(x, base)
        return Estimate(disparity, confidence, (enlarge(base, 4) * 4,))
