"""`hybrid`: the default. A correlation volume, two surfaces per cell, and a choice per pixel.

For an input of 240x320 grey pixels (a cell is 4x4 of them):

1. Shared towers: 3x3 stride 2 to 8 channels at 120x160, 3x3 to 16 at 60x80 and a separable block.
   No pooling. The right tower keeps all 160 columns, so that shifts are 2 px apart.
2. Volume: products of the 16 channels at 32 shifts (0, 2 ... 62 px), 32x60x80, by matrix
   products of blocks of a row (the band along the diagonal is cut out by a change of row length).
3. One 3-D convolution, 3x3x3, depth stride 2, 1 to 2 channels over that volume: 2x16x60x80,
   computed as a 2-D convolution over 16 bands of three neighbouring shifts with shared weights.
4. Volume, its 3-D features and the left features merge (1x1) and look around at 30x40 and 15x20.
   Two sets of scores of the 32 shifts give, by soft-argmin (Kendall et al., ICCV 2017), the
   nearest and the farthest surface within reach of the cell: at an outline they differ, elsewhere
   they agree. One mean per cell would lie between both surfaces and blur every edge (the idea of
   two modes: Tosi et al., CVPR 2021).
5. Evidence: at 120x160 every pixel looks up four right features where each of the two surfaces
   would put it, and their neighbours left and right. A gather by whole columns costs a tenth of
   bilinear sampling; the rest of the rounding is given along.
6. Evidence and left features return to the cells by a strided convolution. A 1x1 convolution
   corrects both surfaces and gives, for each of the 16 pixels of a cell (depth-to-space), the
   share of the near surface, a small correction and the confidence.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from models.networks.blocks import (
    ConvNorm,
    Estimate,
    InvertedResidual,
    Separable,
    conv,
)

SHIFTS, STEP_PX, BLOCK = 32, 2, 16
BAND, KERNELS = 3, 2
FINE, EVIDENCE = 4, 3


def correlation(left: Tensor, right: Tensor) -> Tensor:
    """Mean product of left (b, c, h, w) at x and right (b, c, h, 2w) at 2x - s, s from 31 to 0.

    Returns (b, 32, h, w); left of the right image everything is 0. `side` columns of the left
    image and all that they may meet in the right one are multiplied as two matrices; the wanted
    products lie on diagonals, which become columns when rows are read as two longer.
    """
    batch, channels, height, width = left.shape
    side = math.gcd(width, BLOCK)
    reach = 2 * side + SHIFTS - 1
    blocks = (batch, height, width // side)
    near = left.permute(0, 2, 3, 1) * (1 / channels)
    padded = F.pad(right, (SHIFTS - 1, 0)).permute(0, 2, 1, 3)
    far = torch.stack([padded[..., 2 * x : 2 * x + reach] for x in range(0, width, side)], 2)
    products = torch.matmul(near.reshape(*blocks, side, channels), far)
    flat = F.pad(products.reshape(*blocks, side * reach), (0, 2 * side))
    band = flat.reshape(*blocks, side, reach + 2)[..., :SHIFTS]
    return band.reshape(batch, height, width, SHIFTS).permute(0, 3, 1, 2)


class BandConv3d(nn.Module):
    """3-D convolution 3x3x3 of one channel, depth stride 2: (b, d, h, w) -> (b, d/2 * k, h, w).

    `weight` is (k, 1, 3, 3, 3) as in Conv3d. Every second depth has its band of three slices;
    the bands go through one 2-D convolution as a batch, which is the same arithmetic.
    """

    def __init__(self, kernels: int) -> None:
        super().__init__()
        self.kernels = kernels
        self.weight = nn.Parameter(torch.empty(kernels, 1, BAND, 3, 3))
        nn.init.kaiming_normal_(self.weight, nonlinearity="relu")
        self.bias = nn.Parameter(torch.zeros(kernels))

    def forward(self, volume: Tensor) -> Tensor:
        batch, depth, height, width = volume.shape
        padded = F.pad(volume, (0, 0, 0, 0, 1, 1))
        bands = torch.stack([padded[:, i : i + depth : 2] for i in range(BAND)], 2)
        flat = bands.reshape(batch * depth // 2, BAND, height, width)
        weight = self.weight.reshape(self.kernels, BAND, 3, 3)
        out = F.conv2d(flat, weight, self.bias, padding=1)
        return F.relu(out).reshape(batch, depth // 2 * self.kernels, height, width)


class Tower(nn.Module):
    """Half-size features to 1/4: (b, 8, h, w) -> (b, c, h/2, w/2), or all w columns if `dense`.

    The dense result at even columns is the other one: same weights, other stride and dilation.
    """

    def __init__(self, half: int, features: int) -> None:
        super().__init__()
        self.down = conv(half, features, 3, 2)
        self.around = conv(features, features, 3, groups=features)
        self.mix = conv(features, features, 1, act=False)
        self.descriptor = nn.Conv2d(features, features, 1)

    def forward(self, x: Tensor, dense: bool) -> tuple[Tensor, Tensor]:
        """Features and descriptors."""
        step = 1 if dense else 2
        x = _again(self.down, x, (2, step), (1, 1), (1, 1))
        y = _again(self.around, x, (1, 1), (1, 3 - step), (1, 3 - step))
        x = F.relu(x + self.mix(y))
        return x, self.descriptor(x)


def _again(
    layer: ConvNorm, x: Tensor, stride: tuple[int, int], pad: tuple[int, int],
    dilation: tuple[int, int],
) -> Tensor:  # fmt: skip
    """A layer's weights with another stride and dilation."""
    c = layer.conv
    y = F.conv2d(x, c.weight, c.bias, stride, pad, dilation, c.groups)  # type: ignore[arg-type]
    return layer.act(layer.norm(y))


class Down(nn.Module):
    """Half the size: 3x3 depthwise stride 2, then 1x1."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.body = nn.Sequential(
            conv(inputs, inputs, 3, 2, groups=inputs), conv(inputs, outputs, 1)
        )

    def forward(self, x: Tensor) -> Tensor:
        return self.body(x)


class Hourglass(nn.Module):
    """Look around at 1/8 and 1/16, and come back to 1/4."""

    def __init__(self, wide: int, deep: int, deepest: int) -> None:
        super().__init__()
        self.down8 = Down(wide, deep)
        self.first8 = Separable(deep)
        self.down16 = Down(deep, deepest)
        self.at16 = nn.Sequential(InvertedResidual(deepest, 2), InvertedResidual(deepest, 2, 2))
        self.up8 = nn.Conv2d(deepest, deep, 1)
        self.second8 = Separable(deep)
        self.up4 = nn.Conv2d(deep, wide, 1)
        self.at4 = Separable(wide)

    def forward(self, x: Tensor) -> Tensor:
        y = self.first8(self.down8(x))
        z = self.up8(self.at16(self.down16(y)))
        z = F.interpolate(z, scale_factor=2.0, mode="nearest")
        if z.shape != y.shape:  # an odd height at 1/8
            z = z[:, :, : y.shape[2], : y.shape[3]]
        y = self.second8(F.relu(y + z))
        up = F.interpolate(self.up4(y), scale_factor=2.0, mode="nearest")
        return self.at4(F.relu(x + up))


def soft_argmins(logits: Tensor) -> Tensor:
    """Expected disparity, in cells of 4 px, of two sets of 32 scores: (b, 64, h, w) -> (b, 2, ...).

    Without a softmax: exp, then both sums of both sets as one 1x1 convolution, then a division.
    """
    weight = torch.exp(logits.clamp(-20, 20))
    place = torch.arange(SHIFTS, dtype=weight.dtype, device=weight.device) * (STEP_PX / 4)
    rows = torch.zeros(4, 2, SHIFTS, dtype=weight.dtype, device=weight.device)
    rows[0, 0], rows[1, 1], rows[2, 0], rows[3, 1] = place, place, 1.0, 1.0
    sums = F.conv2d(weight, rows.reshape(4, 2 * SHIFTS, 1, 1))
    return sums[:, :2] / sums[:, 2:]


def look_up(right: Tensor, disparity: Tensor) -> tuple[Tensor, Tensor]:
    """Right features (b, c, h, w) at x - round(disparity), as (b, h, w, c), held at the border.

    Also gives disparity minus its rounding (b, 1, h, w), all in half-size px.
    """
    batch, channels, height, width = right.shape
    whole = torch.round(disparity)
    column = torch.arange(width, dtype=disparity.dtype, device=right.device)
    row = torch.arange(batch * height, device=right.device).view(batch, height, 1) * width
    place = torch.clamp(column - whole[:, 0], min=0).long() + row
    table = right.permute(0, 2, 3, 1).reshape(-1, channels)
    return F.embedding(place, table), disparity - whole


class Evidence(nn.Module):
    """How well both surfaces explain each half-size pixel: (b, 2 * EVIDENCE + 2, h/2, w/2).

    The features begin as FINE descriptors of the pixel to the left, here and to the right in the
    right image, each compared with the same descriptor of the left image.
    """

    def __init__(self, half: int) -> None:
        super().__init__()
        self.left = nn.Conv2d(half, 3 * FINE, 1)
        self.right = nn.Conv2d(half, 3 * FINE, (1, 3), padding=(0, 1))
        self.weigh = nn.Linear(3 * FINE, EVIDENCE)
        with torch.no_grad():
            same = self.left.weight[:FINE].clone()
            self.left.weight.copy_(same.repeat(3, 1, 1, 1))
            self.right.weight.zero_()
            for i in range(3):
                self.right.weight[FINE * i : FINE * (i + 1), :, :, i] = same[:, :, :, 0]
            self.left.bias.zero_()  # type: ignore[union-attr]
            self.right.bias.zero_()  # type: ignore[union-attr]

    def forward(self, left: Tensor, right: Tensor, surfaces: Tensor) -> Tensor:
        """`surfaces` (b, 2, h/4, w/4) in cells; the features (b, 8, h/2, w/2)."""
        here = self.left(left).permute(0, 2, 3, 1)
        there = self.right(right)
        half_px = F.interpolate(surfaces.detach() * 2, scale_factor=2.0, mode="nearest")
        parts = []
        for surface in half_px.split(1, 1):
            found, rest = look_up(there, surface)
            weighed = self.weigh((here - found).abs()).permute(0, 3, 1, 2)
            parts += [weighed, rest.to(weighed.dtype)]
        return torch.cat(parts, 1)


class Hybrid(nn.Module):
    """See the list at the top of the file. The arguments are widths."""

    def __init__(
        self, half: int = 8, features: int = 16, wide: int = 32, deep: int = 64, deepest: int = 80,
        last: int = 48,
    ) -> None:  # fmt: skip
        super().__init__()
        self.stem = conv(1, half, 3, 2)
        self.tower = Tower(half, features)
        self.band = BandConv3d(KERNELS)
        self.merge = conv(SHIFTS + KERNELS * SHIFTS // 2 + features, wide, 1)
        self.context = Hourglass(wide, deep, deepest)
        self.score = nn.Conv2d(wide, 2 * SHIFTS, 1)
        self.evidence = Evidence(half)
        self.gather = nn.Conv2d(half + 2 * EVIDENCE + 2, last, 2, 2)
        self.bring = nn.Conv2d(wide + 2, last, 1)
        self.refine = nn.Sequential(Separable(last), Separable(last))
        self.head = nn.Conv2d(last, 50, 1)

    def surfaces(self, left: Tensor, right: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Features, scores of both sets, and near and far surface in cells, all at 1/4."""
        features, first = self.tower(left, dense=False)
        _, second = self.tower(right, dense=True)
        volume = correlation(first, second)
        x = self.context(self.merge(torch.cat([volume, self.band(volume), features], 1)))
        logits = self.score(x).float()
        return x, logits, soft_argmins(logits)

    def forward(self, left: Tensor, right: Tensor) -> Estimate:
        half_left, half_right = self.stem(torch.cat([left, right], 0)).chunk(2, 0)
        x, logits, both = self.surfaces(half_left, half_right)
        seen = torch.cat([half_left, self.evidence(half_left, half_right, both)], 1)
        brought = torch.cat([x, both.detach().to(x.dtype) / 8], 1)
        y = self.head(self.refine(F.relu(self.gather(seen) + self.bring(brought)))).float()
        near, far = (both + y[:, :2]).chunk(2, 1)
        cell = far + torch.sigmoid(y[:, 2:18]) * (near - far) + y[:, 18:34]
        disparity = F.relu(F.pixel_shuffle(cell * 4, 4))
        return Estimate(disparity, F.pixel_shuffle(y[:, 34:], 4), (), both * 4, logits)
