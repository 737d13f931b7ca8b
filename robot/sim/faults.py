"""What can go wrong with a robot, for trials: switched on and off from outside, off by default."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from robot.sim.collide import inside


@dataclass(frozen=True, slots=True, eq=False)
class Patch:
    """A polygon (k, 2) of floor, scene coordinates, on which the wheels slip or are held.

    `slip` is the share of the rolled way that carries nothing. `blocks` holds one wheel (0 left,
    1 right) still. With `only_ahead` backing is free: an edge, a cable.
    """

    polygon: np.ndarray
    slip: float = 0.0
    blocks: int | None = None
    only_ahead: bool = True


@dataclass(slots=True)
class Faults:
    """The state of everything that can be broken."""

    slip: float = 0.0  # of both wheels, everywhere
    blocked: int | None = None  # wheel that does not turn: 0 left, 1 right
    bump_held: bool = False
    patches: list[Patch] = field(default_factory=list)
    entered: bool = False  # whether a patch has ever acted

    def held(self, x_m: float, y_m: float, ahead: bool) -> tuple[float, set[int]]:
        """(slip share, wheels that stand still) for a robot at this place."""
        slip, still = self.slip, set() if self.blocked is None else {self.blocked}
        for patch in self.patches:
            if (ahead or not patch.only_ahead) and inside(patch.polygon, x_m, y_m):
                slip, self.entered = max(slip, patch.slip), True
                if patch.blocks is not None:
                    still.add(patch.blocks)
        return slip, still
