"""What the networks are trained to do."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional as F

from models.networks.blocks import MAX_DISPARITY, Estimate

BETA_PX = 0.5  # smooth L1 turns from square to straight here
SURE_PX = 2.0  # an estimate this close counts as right for the confidence


def known(truth: Tensor) -> Tensor:
    """Pixels whose true disparity is known and within the networks' range."""
    return torch.isfinite(truth) & (truth > 0) & (truth < MAX_DISPARITY)


def shift_loss(logits: Tensor, truth: Tensor) -> Tensor:
    """Cross-entropy against the two shifts around the truth in the middle of each 4x4 cell."""
    shifts = logits.shape[1]
    middle = truth[:, :, 1::4, 1::4]
    valid = known(middle)[:, 0]
    place = (torch.nan_to_num(middle[:, 0]) / 4).clamp(0, shifts - 1.001)
    low = place.floor()
    share = place - low
    log_p = F.log_softmax(logits, 1)
    index = low.long().unsqueeze(1)
    first, second = log_p.gather(1, index)[:, 0], log_p.gather(1, index + 1)[:, 0]
    each = -((1 - share) * first + share * second)
    return each[valid].sum() / valid.sum().clamp(min=1)


def stereo_loss(estimate: Estimate, truth: Tensor) -> Tensor:
    """Weighted sum over final and coarse disparities, shift scores and confidence.

    `truth` is (b, 1, h, w) px, NaN where unknown; such pixels do not count.
    """
    valid = known(truth)
    target = torch.where(valid, truth, torch.zeros_like(truth))
    count = valid.sum().clamp(min=1)

    def off(disparity: Tensor) -> Tensor:
        each = F.smooth_l1_loss(disparity, target, reduction="none", beta=BETA_PX)
        return (each * valid).sum() / count

    total = off(estimate.disparity)
    for weight, guess in zip((0.5, 0.3), reversed(estimate.coarse), strict=False):
        total = total + weight * off(guess)
    if estimate.logits is not None:
        total = total + 0.5 * shift_loss(estimate.logits, truth)
    right = ((estimate.disparity.detach() - target).abs() < SURE_PX).float()
    doubt = F.binary_cross_entropy_with_logits(estimate.confidence, right, reduction="none")
    return total + 0.2 * (doubt * valid).sum() / count
