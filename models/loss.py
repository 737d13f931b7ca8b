"""What the networks are trained to do."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional as F

from models.networks.blocks import MAX_DISPARITY, Estimate

BETA_PX = 0.5  # smooth L1 turns from square to straight here
SURE_PX = 2.0  # an estimate this close counts as right for the confidence
CELL, MARGIN = 4, 1  # px: side of a cell, and how far it looks beyond for its surfaces


def known(truth: Tensor) -> Tensor:
    """Pixels whose true disparity is known and within the networks' range."""
    return torch.isfinite(truth) & (truth > 0) & (truth < MAX_DISPARITY)


def true_surfaces(truth: Tensor) -> tuple[Tensor, Tensor]:
    """Largest and smallest disparity in and just around each cell (b, 2, h/4, w/4), and validity.

    Cells without a known pixel are not valid.
    """
    valid = known(truth)
    window = CELL + 2 * MARGIN

    def largest(signed: Tensor) -> Tensor:
        return F.max_pool2d(torch.where(valid, signed, -1e3), window, CELL, MARGIN)

    near, far = largest(truth), -largest(-truth)
    return torch.cat([near, far], 1), near > 0


def shift_loss(logits: Tensor, target_px: Tensor, valid: Tensor) -> Tensor:
    """Cross-entropy against the two shifts around the target, (b, n, h, w) and (b, 1, h, w)."""
    shifts = logits.shape[1]
    place = (target_px * (shifts / MAX_DISPARITY)).clamp(0, shifts - 1.001)
    low = place.floor()
    share = place - low
    log_p = F.log_softmax(logits, 1)
    index = low.long()
    each = -((1 - share) * log_p.gather(1, index) + share * log_p.gather(1, index + 1))
    return (each * valid).sum() / valid.sum().clamp(min=1)


def surface_loss(surfaces: Tensor, logits: Tensor, truth: Tensor) -> Tensor:
    """Distance of the near and the far surface of each cell, and their scores."""
    target, valid = true_surfaces(truth)
    target = torch.where(valid, target, 0.0)
    each = F.smooth_l1_loss(surfaces, target, reduction="none", beta=BETA_PX)
    total = (each * valid).sum() / (2 * valid.sum().clamp(min=1))
    for scores, aim in zip(logits.chunk(2, 1), target.chunk(2, 1), strict=True):
        total = total + 0.5 * shift_loss(scores, aim, valid)
    return total


def stereo_loss(estimate: Estimate, truth: Tensor) -> Tensor:
    """Weighted sum over final and coarse disparities, surfaces and confidence.

    `truth` is (b, 1, h, w) px, NaN where unknown; such pixels do not count.
    """
    valid = known(truth)
    target = torch.where(valid, truth, torch.zeros_like(truth))
    count = valid.sum().clamp(min=1)

    def off(disparity: Tensor) -> Tensor:
        each = F.smooth_l1_loss(disparity, target, reduction="none", beta=BETA_PX)
        return (each * valid).sum() / count

    total = off(estimate.disparity)
    for guess in estimate.coarse:
        total = total + 0.5 * off(guess)
    if estimate.logits is not None:
        if estimate.surfaces is not None:
            total = total + 0.5 * surface_loss(estimate.surfaces, estimate.logits, truth)
        else:
            step = truth.shape[3] // estimate.logits.shape[3]
            middle = (..., slice(step // 2 - 1, None, step), slice(step // 2 - 1, None, step))
            total = total + shift_loss(estimate.logits, target[middle], valid[middle])
    right = ((estimate.disparity.detach() - target).abs() < SURE_PX).float()
    doubt = F.binary_cross_entropy_with_logits(estimate.confidence, right, reduction="none")
    return total + 0.2 * (doubt * valid).sum() / count
