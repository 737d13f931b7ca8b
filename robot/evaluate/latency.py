"""How long things take, in the figures that matter to a control loop."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def percentiles(values_ms: Sequence[float] | np.ndarray) -> dict[str, float | None]:
    """Median, 95th and 99th percentile, in the unit given; None where nothing was measured.

    Unknown values (NaN) are left out. Percentiles are interpolated linearly (Hyndman and Fan,
    The American Statistician 1996, type 7).
    """
    known = np.asarray(values_ms, dtype=float)
    known = known[np.isfinite(known)]
    if known.size == 0:
        return {"p50": None, "p95": None, "p99": None}
    figures = np.percentile(known, (50.0, 95.0, 99.0))
    return {
        name: round(float(v), 3) for name, v in zip(("p50", "p95", "p99"), figures, strict=True)
    }
