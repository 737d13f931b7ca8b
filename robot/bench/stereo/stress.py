"""`sweeper bench stereo --stress`: what disturbed pictures and swapped eyes do to the matchers.

Every disturbance is applied to the pairs of the protocol (320x240); reported is bad-2 of the dense
map, over all pixels with truth, and by how much it grew. Swapped eyes have no right answer: there,
the share of pixels that a matcher still believes is reported, which must be small.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from robot.bench.stereo.matchers import MODELS, Matcher, make_matcher
from robot.bench.stereo.pairs import TruePair, find_pairs
from robot.evaluate.stereo import fill_background, stereo_errors

SURE = 0.5  # a pixel is believed from this confidence on
Eyes = tuple[np.ndarray, np.ndarray]
Disturb = Callable[[np.random.Generator, np.ndarray, np.ndarray], Eyes]


def _bytes(grey: np.ndarray) -> np.ndarray:
    return np.clip(np.rint(grey), 0, 255).astype(np.uint8)


def _gamma(image: np.ndarray, gamma: float) -> np.ndarray:
    return _bytes(255 * (image / 255.0) ** gamma)


def _grain(rng: np.random.Generator, image: np.ndarray, sigma: float) -> np.ndarray:
    return _bytes(image + rng.normal(0, sigma, image.shape))


def shifted(image: np.ndarray, rows: int) -> np.ndarray:
    """The picture moved down by `rows` px (up if negative), its border repeated."""
    matrix = np.array([[1, 0, 0], [0, 1, rows]], np.float32)
    size = image.shape[1], image.shape[0]
    return cv2.warpAffine(image, matrix, size, borderMode=cv2.BORDER_REPLICATE)


DISTURBANCES: dict[str, Disturb] = {
    "none": lambda rng, left, right: (left, right),
    "gamma 0.7, both eyes": lambda rng, left, right: (_gamma(left, 0.7), _gamma(right, 0.7)),
    "gamma 1.3, both eyes": lambda rng, left, right: (_gamma(left, 1.3), _gamma(right, 1.3)),
    "gamma 1.3, right eye": lambda rng, left, right: (left, _gamma(right, 1.3)),
    "exposure x0.7, right eye": lambda rng, left, right: (left, _bytes(0.7 * right)),
    "noise sigma 5": lambda rng, left, right: (_grain(rng, left, 5), _grain(rng, right, 5)),
    "blur sigma 1.5": lambda rng, left, right: (
        cv2.GaussianBlur(left, (0, 0), 1.5), cv2.GaussianBlur(right, (0, 0), 1.5)
    ),
    "right eye 1 px lower": lambda rng, left, right: (left, shifted(right, 1)),
    "right eye 1 px higher": lambda rng, left, right: (left, shifted(right, -1)),
}  # fmt: skip


def disturbed(pair: TruePair, name: str, index: int) -> TruePair:
    """A pair after one of DISTURBANCES; the noise depends on `index` alone."""
    rng = np.random.default_rng(index)
    left, right = DISTURBANCES[name](rng, pair.left, pair.right)
    return replace(pair, left=left, right=right)


def _dense(matcher: Matcher, pair: TruePair) -> np.ndarray:
    found = matcher.match(pair.left, pair.right)
    return fill_background(found) if np.isnan(found).any() else found


def _bad2_pct(matcher: Matcher, pairs: list[TruePair]) -> float:
    each = [stereo_errors(_dense(matcher, p), p.truth_px).bad2_pct for p in pairs]
    return float(np.nanmean(each))


def believed_pct(matcher: Matcher, pairs: list[TruePair], swapped: bool) -> float:
    """Mean share of pixels with a disparity and a confidence of at least SURE."""
    shares = []
    for pair in pairs:
        eyes = (pair.right, pair.left) if swapped else (pair.left, pair.right)
        shares.append(100.0 * float((matcher.trust(*eyes) >= SURE).mean()))
    return float(np.mean(shares))


def bench_stress(
    pairs_dir: Path, matchers: list[str], models: Path = MODELS, threads: int = 1
) -> dict[str, Any]:
    """Measure `matchers` under every disturbance, over all pairs under `pairs_dir`.

    Returns `{"stress": [{"matcher", "disturbance", "bad2_pct", "growth_pct"}], "swapped":
    [{"matcher", "believed_pct", "believed_swapped_pct"}]}`; growth is in percentage points.
    Raises DataError for a folder without pairs and ModelError for an unknown network.
    """
    cv2.setNumThreads(threads)
    pairs = find_pairs(pairs_dir)
    made = [make_matcher(name, models, threads) for name in dict.fromkeys(matchers)]
    rows, swapped = [], []
    for matcher in made:
        calm = 0.0
        for name in DISTURBANCES:
            bad2 = _bad2_pct(matcher, [disturbed(p, name, i) for i, p in enumerate(pairs)])
            calm = bad2 if name == "none" else calm
            rows.append(
                {
                    "matcher": matcher.name,
                    "disturbance": name,
                    "bad2_pct": round(bad2, 2),
                    "growth_pct": round(bad2 - calm, 2),
                }
            )
        swapped.append(
            {
                "matcher": matcher.name,
                "believed_pct": round(believed_pct(matcher, pairs, False), 1),
                "believed_swapped_pct": round(believed_pct(matcher, pairs, True), 1),
            }
        )
    return {"stress": rows, "swapped": swapped}
