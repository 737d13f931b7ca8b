"""The networks by name. Input: two grey images (b, 1, h, w), (grey - 128) / 64, h and w of 8."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from torch import nn

from models.networks.blocks import Estimate, Exported, fold_norms
from models.networks.cost_volume import CostVolume
from models.networks.hybrid import Hybrid
from models.networks.hybrid_paper import HybridPaper
from models.networks.similarity import Similarity

NETWORKS: dict[str, Callable[[], nn.Module]] = {
    "hybrid": Hybrid,
    # For a Pi 4 or 5: every width about doubled.
    "hybrid_m": partial(Hybrid, half=16, features=32, wide=64, deep=128, deepest=160, last=96),
    # A point of the curve of width against accuracy.
    "hybrid_s": partial(Hybrid, wide=24, deep=48, deepest=64, last=32),
    "hybrid_paper": HybridPaper,
    "similarity": Similarity,
    "cost_volume": CostVolume,
}

WIDTHS = ("hybrid_m", "hybrid_s")  # other sizes of `hybrid`, in its file

__all__ = ["NETWORKS", "Estimate", "Exported", "build", "fold_norms", "module_of"]


def build(name: str) -> nn.Module:
    """A fresh network in training mode; KeyError names an unknown one."""
    return NETWORKS[name]()


def module_of(name: str) -> str:
    """The module that defines a network: other widths of `hybrid` share its file."""
    return "models.networks." + ("hybrid" if name in WIDTHS else name)
