"""`hybrid`: the default. Correlation instead of learnt differences, then coarse to fine.

For an input of 240x320 grey pixels:

1. Shared towers: 3x3 stride 2 to 8 channels at 120x160, 3x3 stride 2 to 16 at 60x80, a 3x3 and a
   separable block, a linear 1x1. No pooling.
2. Correlation in two groups of 8 channels at 16 shifts (0, 4 ... 60 px): a volume 2x16x60x80.
3. One 3-D convolution, 3x3x3, depth stride 2, 2 to 4 channels over that volume: 4x8x60x80. It is
   computed as a 2-D convolution over 8 bands of three neighbouring shifts with shared weights.
4. Volume, its 3-D features and the left features merge (1x1 to 32), look around at 30x40 in
   dilated inverted residuals, and score the 16 shifts; a soft-argmin gives the coarse disparity
   (Kendall et al., ICCV 2017), written as exp, two sums and a division.
5. Fine stage: at 120x160 four right features are warped once by the coarse disparity; absolute
   differences at 5 neighbouring shifts say what is left. A strided convolution brings them back
   to 60x80, where they correct the disparity; depth-to-space gives the 4x4 pixels of each cell.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from models.networks.blocks import (
    Context,
    ConvNorm,
    Estimate,
    Head,
    Separable,
    conv,
    enlarge,
)

SHIFTS, GROUPS, BAND, FINE, BLOCK = 16, 2, 3, 4, 16
FINE_SHIFTS = (-2, -1, 0, 1, 2)


def correlation(left: Tensor, right: Tensor, shifts: int, groups: int) -> Tensor:
    """Mean product of left(x) and right(x - s) per group of channels: (b, groups, shifts, h, w).

    `side` columns of the left image and all that they may meet in the right one, from right to
    left, are multiplied as two matrices; the wanted products lie on diagonals, which become columns
    when the rows are read as one shorter. That is cheaper than products and sums shift by shift.
    """
    batch, channels, height, width = left.shape
    side = math.gcd(width, BLOCK)
    reach, size = side + shifts - 1, channels // groups
    blocks = (batch, height, width // side)
    mirrored = F.pad(right, (shifts - 1, 0)).flip(3).permute(0, 2, 1, 3)
    starts = range(width - side, -1, -side)
    far = torch.stack([mirrored[..., x : x + reach] for x in starts], 2)
    near = (left * (1 / size)).permute(0, 2, 3, 1).reshape(*blocks, side, channels)
    volumes = []
    for g in range(groups):
        own = slice(g * size, (g + 1) * size)
        products = torch.matmul(near[..., own], far[..., own, :]).reshape(*blocks, side * reach)
        shorter = products[..., side - 1 : side - 1 + side * (reach - 1)]
        band = shorter.reshape(*blocks, side, reach - 1)[..., :shifts]
        volumes.append(band.reshape(batch, height, width, shifts))
    return torch.stack(volumes, 1).permute(0, 1, 4, 2, 3)


class BandConv3d(nn.Module):
    """3-D convolution 3x3x3, depth stride 2, padding 1: (b, g, d, h, w) -> (b * d/2, k, h, w).

    `weight` is (k, g, 3, 3, 3) as in Conv3d. Every second depth has its band of three slices;
    the bands go through one 2-D convolution as a batch, which is the same arithmetic.
    """

    def __init__(self, groups: int, kernels: int) -> None:
        super().__init__()
        self.kernels = kernels
        self.weight = nn.Parameter(torch.empty(kernels, groups, BAND, 3, 3))
        nn.init.kaiming_normal_(self.weight, nonlinearity="relu")
        self.bias: nn.Parameter | None = None

    def forward(self, volume: Tensor) -> Tensor:
        batch, groups, depth, height, width = volume.shape
        padded = F.pad(volume, (0, 0, 0, 0, 1, 1))
        bands = torch.stack([padded[:, :, i : i + depth : 2] for i in range(BAND)], 3)
        flat = bands.transpose(1, 2).reshape(batch * depth // 2, groups * BAND, height, width)
        weight = self.weight.reshape(self.kernels, groups * BAND, 3, 3)
        return F.conv2d(flat, weight, self.bias, padding=1)


def soft_argmin(logits: Tensor) -> Tensor:
    """Expected index over the channels of (b, n, h, w), without a softmax: (b, 1, h, w)."""
    weight = torch.exp(logits.clamp(-20, 20))
    index = torch.arange(logits.shape[1], dtype=weight.dtype, device=weight.device)
    index = index.view(1, -1, 1, 1)
    return F.conv2d(weight, index) / F.conv2d(weight, torch.ones_like(index))


def warp(features: Tensor, disparity_px: Tensor) -> Tensor:
    """Sample features (b, c, h, w) at x - disparity (b, 1, h, w), held at the border.

    Both columns around each place are looked up with all their channels at once, and mixed: the
    same as bilinear sampling (GridSample), at a fraction of its cost.
    """
    batch, channels, height, width = features.shape
    table = features.permute(0, 2, 3, 1).reshape(-1, channels)
    column = torch.arange(width, dtype=disparity_px.dtype, device=features.device)
    row = torch.arange(batch * height, device=features.device).view(batch, height, 1) * width
    place = (column - disparity_px[:, 0]).clamp(0, width - 1)
    whole = torch.floor(place)
    here = F.embedding(row + whole.long(), table)
    there = F.embedding(row + (whole + 1).clamp(max=width - 1).long(), table)
    share = (place - whole).unsqueeze(1)
    here, there = here.permute(0, 3, 1, 2), there.permute(0, 3, 1, 2)
    return here + share * (there - here)


def differences(left: Tensor, warped: Tensor) -> Tensor:
    """Sum over 4 channels of |left(x) - warped(x + s)| for the fine shifts: (b, 5, h, w)."""
    reach, width = FINE_SHIFTS[-1], left.shape[3]
    padded = F.pad(warped, (reach, reach, 0, 0))
    slices = [padded[:, :, :, reach + s : reach + s + width] for s in FINE_SHIFTS]
    # Summing by a convolution of ones is cheaper than a reduction, or than one for all five.
    ones = torch.ones(1, FINE, 1, 1, dtype=left.dtype, device=left.device)
    return torch.cat([F.conv2d((left - x).abs(), ones) for x in slices], 1)


class Hybrid(nn.Module):
    """See the list at the top of the file. `wide` sets the width of the context at 1/8.

    `dilations` gives its blocks, `refinements` the number of separable blocks before the head.
    """

    def __init__(
        self, features: int = 16, half: int = 8, wide: int = 48,
        dilations: tuple[int, ...] = (1, 2, 4, 1), refinements: int = 2,
    ) -> None:  # fmt: skip
        super().__init__()
        volume = GROUPS * SHIFTS
        self.stem = conv(1, half, 3, 2)
        self.tower = nn.Sequential(
            conv(half, features, 3, 2), conv(features, features), Separable(features)
        )
        self.descriptor = nn.Conv2d(features, features, 1)
        self.fine_descriptor = nn.Conv2d(half, FINE, 1)
        self.band = ConvNorm(BandConv3d(GROUPS, 4), 4)
        self.merge = conv(volume + 4 * SHIFTS // 2 + features, 32, 1)
        self.context = Context(32, wide, 32, dilations, 3)
        self.score = nn.Conv2d(32, SHIFTS, 1)
        self.correct = nn.Conv2d(32, 1, 1)
        self.evidence = conv(half + len(FINE_SHIFTS) + 1, 32, 3, 2)
        self.join = conv(32 + 32, 32, 1)
        self.refine = nn.Sequential(*(Separable(32) for _ in range(refinements)))
        self.head = Head(32)

    def coarse(self, left: Tensor, right: Tensor) -> tuple[Tensor, Tensor]:
        """Features and scores of the 16 shifts at 1/4 from tower features of both eyes."""
        first, second = self.descriptor(left), self.descriptor(right)
        volume = correlation(first, second, SHIFTS, GROUPS)
        banded = self.band(volume)
        batch, _, _, height, width = volume.shape
        everything = (
            volume.reshape(batch, -1, height, width),
            banded.reshape(batch, -1, height, width),
            left,
        )
        x = self.context(self.merge(torch.cat(everything, 1)))
        return x, self.score(x).float()

    def forward(self, left: Tensor, right: Tensor) -> Estimate:
        both_half = self.stem(torch.cat([left, right], 0))
        x, logits = self.coarse(*self.tower(both_half).chunk(2, 0))
        first = soft_argmin(logits)
        base = F.relu(first + self.correct(x).float())
        half_px = enlarge(base, 2) * 2
        fine = self.fine_descriptor(both_half).float()
        fine_left, fine_right = fine.chunk(2, 0)
        rest = differences(fine_left, warp(fine_right, half_px.detach()))
        seen = torch.cat([both_half.chunk(2, 0)[0], rest.to(x.dtype), half_px.to(x.dtype) / 16], 1)
        x = self.refine(self.join(torch.cat([x, self.evidence(seen)], 1)))
        disparity, confidence = self.head(x, base)
        coarse = (enlarge(first, 4) * 4, enlarge(base, 4) * 4)
        return Estimate(disparity, confidence, coarse, None, logits)
