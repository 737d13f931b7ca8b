"""`sweeper bench stereo --native`: every pair at its own size, as its data set measures it.

SGBM and BM search the same share of the width as in the protocol (64 of 320 px). A network has one
size: the pair is brought to it, and its disparity map is enlarged again and scaled. That costs it
accuracy, and the rows say by how much. KITTI's D1 stands beside bad-N.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from robot.bench.stereo.matchers import CLASSICAL, MODELS, classical_match, make_matcher
from robot.bench.stereo.pairs import HEIGHT_PX, WIDTH_PX, TruePair, as_it_is, find_pairs
from robot.config import CameraConfig
from robot.evaluate.stereo import MAX_DISPARITY_PX, fill_background, stereo_errors
from robot.evaluate.stereo_kitti import kitti_errors

Match = Callable[[np.ndarray, np.ndarray], np.ndarray]
MEASURES = ("density_pct", "bad1_pct", "bad2_pct", "bad3_pct", "epe_px", "d1_all_pct", "ms")


def searched_px(width: int) -> int:
    """Disparities to search in an image so wide: as many as the protocol's, a multiple of 16."""
    return 16 * math.ceil(MAX_DISPARITY_PX * width / WIDTH_PX / 16)


def enlarged(match: Match) -> Match:
    """A matcher of 320x240 for any size: shrink the pair, enlarge and scale the disparity."""

    def whole(left: np.ndarray, right: np.ndarray) -> np.ndarray:
        height, width = left.shape
        size = (WIDTH_PX, HEIGHT_PX)
        small = match(
            cv2.resize(left, size, interpolation=cv2.INTER_AREA),
            cv2.resize(right, size, interpolation=cv2.INTER_AREA),
        )
        grown = cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR)
        return grown * np.float32(width / WIDTH_PX)

    return whole


def _matcher(name: str, width: int, height: int, models: Path, threads: int) -> Match:
    if name not in CLASSICAL:
        return enlarged(make_matcher(name, models, threads).match)
    camera = replace(CameraConfig().stereo_camera(), width_px=width, height_px=height)
    return classical_match(name, camera, searched_px(width))


def _row(name: str, match: Match, pair: TruePair, filled: bool) -> dict[str, Any]:
    began = time.perf_counter()
    found = match(pair.left, pair.right)
    if filled and np.isnan(found).any():
        found = fill_background(found)
    ms = 1e3 * (time.perf_counter() - began)
    limit = MAX_DISPARITY_PX * pair.left.shape[1] / WIDTH_PX
    errors = stereo_errors(found, pair.truth_px, None, limit)
    d1 = kitti_errors(found, np.where(pair.truth_px < limit, pair.truth_px, np.nan))
    measured = {m: getattr(errors, m) for m in MEASURES if hasattr(errors, m)}
    return {
        "matcher": name, "family": pair.family, "pair": pair.name, "mask": "all", "filled": filled,
        "size": [pair.left.shape[1], pair.left.shape[0]],
        **measured, "d1_all_pct": d1.d1_all_pct, "ms": ms,
    }  # fmt: skip


def _mean(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """One row for all pairs of a family; measures that are NaN do not count."""
    values = {m: np.array([r[m] for r in rows]) for m in MEASURES}
    known = {m: v[np.isfinite(v)] for m, v in values.items()}
    means = {m: float(v.mean()) if len(v) else math.nan for m, v in known.items()}
    return {**rows[0], "pair": None, "size": None, **means}


def _tidy(row: dict[str, Any]) -> dict[str, Any]:
    """Three digits, and None for what could not be measured."""
    values = {m: round(row[m], 3) if math.isfinite(row[m]) else None for m in MEASURES}
    return row | values


def bench_native(
    pairs_dir: Path, matchers: list[str], models: Path = MODELS, threads: int = 1
) -> dict[str, Any]:
    """Measure `matchers` on every pair under `pairs_dir` at its own size.

    Returns `{"size": None, "threads", "rows"}` with the keys of `sweeper bench stereo`, and `size`
    and `d1_all_pct` in each row. Raises DataError for a folder without pairs and ModelError for an
    unknown network.
    """
    cv2.setNumThreads(threads)
    pairs = find_pairs(pairs_dir, as_it_is)
    rows: list[dict[str, Any]] = []
    for name in dict.fromkeys(matchers):
        made: dict[tuple[int, int], Match] = {}
        own: list[dict[str, Any]] = []
        for pair in pairs:
            height, width = pair.left.shape
            if (width, height) not in made:
                made[width, height] = _matcher(name, width, height, models, threads)
            own += [_row(name, made[width, height], pair, filled) for filled in (False, True)]
        for filled in (False, True):
            for family in sorted({p.family for p in pairs}):
                group = [r for r in own if r["family"] == family and r["filled"] is filled]
                rows.append(_mean(group))
        rows += own
    return {"size": None, "threads": threads, "rows": [_tidy(r) for r in rows]}
