"""`similarity`: for comparison. Siamese features, inner product, and the post-processing it needs.

After Luo, Schwing and Urtasun (CVPR 2016) and Zbontar and LeCun (JMLR 2016), small. For 240x320:

1. Shared tower: 3x3 stride 2 to 16 channels at 120x160, two more 3x3, a linear 3x3.
2. Similarity: inner product at 32 shifts (0, 2 ... 62 px), 32x120x160, trained as a classifier.
3. Post-processing, in inference only: mean over 9x9, the best shift of either eye, a parabola
   through its neighbours, the left-right check. What fails the check is NaN and needs filling.

There is no regression: nothing but the mean looks farther than the tower's 19 pixels.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from models.networks.blocks import Estimate, conv, enlarge

SHIFTS, WINDOW, AGREE = 32, 9, 1.0
SURE, UNSURE = 4.0, -4.0  # logits of the confidence inside and outside the check


def similarities(left: Tensor, right: Tensor) -> Tensor:
    """Inner products of left (b, c, h, w) at x and right at x - s: (b, 32, h, w), 0 outside."""
    padded = F.pad(right, (SHIFTS - 1, 0))
    width = left.shape[3]
    found = []
    for s in range(SHIFTS):
        start = SHIFTS - 1 - s
        found.append((left * padded[..., start : start + width]).sum(1))
    return torch.stack(found, 1)


def of_right_eye(volume: Tensor) -> Tensor:
    """The same similarities by columns of the right image: out(x, s) = volume(x + s, s)."""
    width = volume.shape[3]
    padded = F.pad(volume, (0, SHIFTS - 1), value=-1e4)
    return torch.stack([padded[:, s, :, s : s + width] for s in range(SHIFTS)], 1)


def parabola(volume: Tensor, best: Tensor) -> Tensor:
    """Vertex of the parabola through the best shift (b, 1, h, w) and both neighbours."""
    low, high = (best - 1).clamp(min=0), (best + 1).clamp(max=SHIFTS - 1)
    before, at, after = (volume.gather(1, i) for i in (low, best, high))
    bend = (2 * at - before - after).clamp(min=1e-6)
    return best + (0.5 * (after - before) / bend).clamp(-0.5, 0.5)


class Similarity(nn.Module):
    """See the list at the top of the file."""

    def __init__(self, features: int = 16) -> None:
        super().__init__()
        self.tower = nn.Sequential(
            conv(1, features, 3, 2), conv(features, features), conv(features, features),
            nn.Conv2d(features, features, 3, 1, 1),
        )  # fmt: skip

    def forward(self, left: Tensor, right: Tensor) -> Estimate:
        first, second = self.tower(torch.cat([left, right], 0)).float().chunk(2, 0)
        volume = similarities(first, second)
        if self.training:
            place = torch.arange(SHIFTS, device=volume.device).view(1, SHIFTS, 1, 1)
            mean = (volume.softmax(1) * place).sum(1, keepdim=True)
            return Estimate(enlarge(2 * mean, 2), torch.zeros_like(left), (), None, volume)
        smooth = F.avg_pool2d(volume, WINDOW, 1, WINDOW // 2, count_include_pad=False)
        best = smooth.argmax(1, keepdim=True)
        other = of_right_eye(smooth).argmax(1, keepdim=True)
        column = torch.arange(volume.shape[3], device=volume.device).view(1, 1, 1, -1)
        back = other.gather(3, (column - best).clamp(min=0).expand(best.shape))
        agrees = ((best - back).abs() <= AGREE) & (column >= best) & (best > 0)
        gap = torch.full_like(smooth[:, :1], float("nan"))
        disparity = torch.where(agrees, 2 * parabola(smooth, best), gap)
        sure = torch.where(agrees, SURE, UNSURE)
        grow = {"scale_factor": 2.0, "mode": "nearest"}
        return Estimate(
            F.interpolate(disparity, **grow), F.interpolate(sure, **grow), (), None, volume
        )
