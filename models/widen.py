"""Start a wide `hybrid` from a narrow one that has learnt (Net2Net: Chen et al., ICLR 2016).

Every weight goes to its place in the wide network. New channels keep their random start, but what
the old ones take from them begins at zero: at first the wide network says almost what the narrow
one says, and learns on from there.
"""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor, nn

# Inputs that follow those which grow: the evidence behind the half-size features, the two surfaces
# behind the merged ones.
TAILS = {"gather.weight": 8, "bring.weight": 2}
FAINT = 0.1  # of new descriptors, whose products join the volume: at zero neither eye would learn


def widened(narrow: Mapping[str, Tensor], network: nn.Module) -> dict[str, Tensor]:
    """The state for `network` that begins with what `narrow` knows.

    The same network's state is returned unchanged. Raises ValueError if `narrow` is wider, or of
    another network.
    """
    state = network.state_dict()
    if set(state) != set(narrow):
        raise ValueError("these weights are of another network")
    for name, value in state.items():
        _place(narrow[name], value, name)
    return state


def _place(old: Tensor, new: Tensor, name: str) -> None:
    """Write `old` into `new`, old outputs first, then whatever else `new` has."""
    if any(o > n for o, n in zip(old.shape, new.shape, strict=True)):
        raise ValueError(f"{name}: {tuple(old.shape)} is wider than {tuple(new.shape)}")
    if not old.shape:
        new.copy_(old)
        return
    outputs = old.shape[0]
    if name.startswith("tower.descriptor"):
        # The volume is a mean over the descriptors: more of them must not make it fainter.
        new[outputs:] *= FAINT
        old = old * (len(new) / outputs) ** 0.5
    if old.dim() == 1:
        new[:outputs] = old
        return
    inputs, tail = old.shape[1], TAILS.get(name, 0)
    grown = torch.zeros_like(new[:outputs])
    grown[:, : inputs - tail] = old[:, : inputs - tail]
    if tail:
        grown[:, -tail:] = old[:, -tail:]
    new[:outputs] = grown
