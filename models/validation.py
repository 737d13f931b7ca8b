"""Errors of a network on held-back rendered pairs, while it is trained."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from torch import nn

from models.data.batches import Shards
from models.networks.blocks import INPUT_MEAN, INPUT_SCALE, MAX_DISPARITY
from robot.evaluate.stereo import fill_background


def predict(network: nn.Module, images: np.ndarray, size: int = 8) -> np.ndarray:
    """Disparity float32 (n, h, w) px for images uint8 (n, 2, h, w), in eval mode."""
    was_training, device = network.training, next(network.parameters()).device
    network.eval()
    found = []
    with torch.no_grad():
        for first in range(0, len(images), size):
            grey = torch.from_numpy(images[first : first + size].astype(np.float32)).to(device)
            x = (grey - INPUT_MEAN) / INPUT_SCALE
            found.append(network(x[:, :1], x[:, 1:]).disparity[:, 0].cpu().numpy())
    network.train(was_training)
    return np.concatenate(found)


def measure(network: nn.Module, folder: Path, kinds: tuple[str, ...]) -> dict[str, float]:
    """EPE and bad-1/2/3 (percent) per kind of pair that the folder holds; gaps are filled."""
    result: dict[str, float] = {}
    for kind in kinds:
        shards = Shards(folder, kind)
        if not shards.images:
            continue
        images, truth = shards.everything()
        valid = np.isfinite(truth) & (truth > 0) & (truth < MAX_DISPARITY)
        found = np.stack([fill_background(disparity) for disparity in predict(network, images)])
        off = np.abs(found - np.nan_to_num(truth))[valid]
        result[f"{kind}_epe_px"] = float(off.mean())
        for n in (1, 2, 3):
            result[f"{kind}_bad{n}_pct"] = float(100 * (off > n).mean())
    return result
