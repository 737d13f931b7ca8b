"""`sweeper bench stereo --confidence`: how good are the pixels that a matcher believes most?

SGBM leaves pixels empty where it is unsure. Each network gives as many pixels per pair, those of
its highest confidence, and bad-2 over the kept pixels with truth is compared.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np

from robot.bench.stereo.matchers import CLASSICAL, MODELS, make_matcher
from robot.bench.stereo.pairs import find_pairs
from robot.evaluate.stereo import countable


def most_trusted(trust: np.ndarray, count: int) -> np.ndarray:
    """Bool (h, w): the `count` pixels of highest confidence; equal ones in order of place."""
    order = np.argsort(-trust, axis=None, kind="stable")
    kept = np.zeros(trust.size, np.bool_)
    kept[order[:count]] = True
    return kept.reshape(trust.shape)


def bad2_of_kept_pct(disparity: np.ndarray, truth: np.ndarray, kept: np.ndarray) -> float:
    """Percent of kept pixels with truth that are off by more than 2 px; NaN without any."""
    counted = countable(truth) & kept
    if not counted.any():
        return float("nan")
    off = np.abs(disparity[counted] - truth[counted])
    return 100.0 * float(((off > 2) | np.isnan(off)).mean())


def bench_confidence(
    pairs_dir: Path, matchers: list[str], models: Path = MODELS, threads: int = 1
) -> dict[str, Any]:
    """Compare networks with SGBM at SGBM's density, pair by pair.

    Returns `{"confidence": [{"matcher", "density_pct", "bad2_pct"}]}`, means over pairs; SGBM comes
    first. Raises DataError for a folder without pairs and ModelError for an unknown network.
    """
    cv2.setNumThreads(threads)
    pairs = find_pairs(pairs_dir)
    reference = make_matcher("sgbm", models, threads)
    kept = [np.isfinite(reference.match(p.left, p.right)) for p in pairs]
    networks = [m for m in dict.fromkeys(matchers) if m not in CLASSICAL]
    rows = []
    for matcher in [reference, *(make_matcher(n, models, threads) for n in networks)]:
        bad, density = [], []
        for pair, reference_kept in zip(pairs, kept, strict=True):
            chosen = reference_kept
            if matcher is not reference:
                trust = matcher.trust(pair.left, pair.right)
                chosen = most_trusted(trust, int(reference_kept.sum()))
            found = matcher.match(pair.left, pair.right)
            bad.append(bad2_of_kept_pct(found, pair.truth_px, chosen))
            density.append(100.0 * float(chosen.mean()))
        rows.append(
            {
                "matcher": matcher.name,
                "density_pct": round(float(np.mean(density)), 1),
                "bad2_pct": round(float(np.nanmean(bad)), 2),
            }
        )
    return {"confidence": rows}
