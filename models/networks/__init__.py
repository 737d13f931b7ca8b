"""The networks by name. Input: two grey images (b, 1, h, w), (grey - 128) / 64, h and w of 8."""

from __future__ import annotations

from torch import nn

from models.networks.blocks import Estimate, Exported, fold_norms
from models.networks.hybrid import Hybrid
from models.networks.hybrid_paper import HybridPaper

NETWORKS: dict[str, type[nn.Module]] = {"hybrid": Hybrid, "hybrid_paper": HybridPaper}

__all__ = ["NETWORKS", "Estimate", "Exported", "Hybrid", "HybridPaper", "build", "fold_norms"]


def build(name: str) -> nn.Module:
    """A fresh network in training mode; KeyError names an unknown one."""
    return NETWORKS[name]()
