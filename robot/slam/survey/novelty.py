"""How likely it is that a sight shows something that nobody saw before.

The rival of every landmark is something new. Reid, "An algorithm for tracking multiple targets"
(IEEE Trans. Automatic Control 1979), weighs it by the density of new things: here as many a square
metre as stand around already, times the share of new ones among all that came into view (Laplace's
rule of succession). After a long way without sights the filter spreads a landmark over so much
floor that something new is as likely; then a sight tells nothing.
"""

from __future__ import annotations

import numpy as np


def novelty_cost(range_m: np.ndarray, away_m: np.ndarray, new: int, again: int) -> float:
    """What it costs that the sights at `range_m` (p,) show new things, to be compared with the
    chi-square plus log determinant of pairs with landmarks.

    `away_m` (n,) are the distances of all landmarks; so far `new` things came into view, and
    known ones came `again`.
    """
    around = (away_m[None] < range_m[:, None]).sum(axis=1)
    share = (new + 1.0) / (new + again + 2.0)
    per_m2 = share * (1.0 + around) / (np.pi * range_m**2)
    per_sight = per_m2 * range_m**3  # a sight is an inverse range and a bearing
    return float(-2.0 * np.log(2.0 * np.pi * per_sight).sum())
