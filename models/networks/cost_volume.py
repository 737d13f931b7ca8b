"""`cost_volume`: for comparison. A volume of features, 3-D convolutions, soft-argmin.

After GC-Net (Kendall et al., ICCV 2017) and PSMNet (Chang and Chen, CVPR 2018), small. For 240x320:

1. Shared tower: 3x3 stride 2 to 8 channels, 3x3 stride 2 to 16, a residual block, linear to 8.
2. Volume at 1/4 and 16 shifts (0, 4 ... 60 px): differences of the 8 features, 8x16x60x80.
3. Six 3-D convolutions 3x3x3 of 8 channels, two of them at half the size (an hourglass), and one
   to a single score.
4. Soft-argmin over the shifts, bilinear upsampling.

A single 3-D convolution of it multiplies as much as half of `hybrid`.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from models.networks.blocks import Estimate, Residual, conv, enlarge

SHIFTS, STEP_PX = 16, 4


def difference_volume(left: Tensor, right: Tensor) -> Tensor:
    """left(x) - right(x - s) for every feature and shift: (b, c, 16, h, w), right 0 outside."""
    padded = F.pad(right, (SHIFTS - 1, 0))
    width = left.shape[3]
    starts = range(SHIFTS - 1, -1, -1)
    return torch.stack([left - padded[..., i : i + width] for i in starts], 2)


def conv3d(inputs: int, outputs: int, stride: int = 1) -> nn.Sequential:
    """3x3x3 convolution, normalised, ReLU; the normalisation is folded when exported."""
    return nn.Sequential(
        nn.Conv3d(inputs, outputs, 3, stride, 1, bias=False), nn.BatchNorm3d(outputs), nn.ReLU()
    )


class CostVolume(nn.Module):
    """See the list at the top of the file."""

    def __init__(self, half: int = 8, features: int = 16, deep: int = 8) -> None:
        super().__init__()
        self.tower = nn.Sequential(
            conv(1, half, 3, 2), conv(half, features, 3, 2), Residual(features),
            nn.Conv2d(features, deep, 3, 1, 1),
        )  # fmt: skip
        self.first = nn.Sequential(conv3d(deep, deep), conv3d(deep, deep))
        self.down = nn.Sequential(conv3d(deep, 2 * deep, 2), conv3d(2 * deep, 2 * deep))
        self.up = nn.Conv3d(2 * deep, deep, 1)
        self.last = nn.Sequential(conv3d(deep, deep), nn.Conv3d(deep, 1, 3, 1, 1))

    def forward(self, left: Tensor, right: Tensor) -> Estimate:
        volume = difference_volume(*self.tower(torch.cat([left, right], 0)).chunk(2, 0))
        x = self.first(volume)
        far = F.interpolate(self.up(self.down(x)), scale_factor=2.0, mode="nearest")
        logits = self.last(F.relu(x + far[:, :, :, : x.shape[3], : x.shape[4]]))[:, 0].float()
        share = logits.softmax(1)
        place = torch.arange(SHIFTS, device=logits.device).view(1, SHIFTS, 1, 1)
        mean = (share * place).sum(1, keepdim=True)
        most = share.amax(1, keepdim=True).clamp(1e-4, 1 - 1e-4)
        confidence = enlarge(torch.log(most / (1 - most)), 4)
        return Estimate(enlarge(STEP_PX * mean, 4), confidence, (), None, logits)
