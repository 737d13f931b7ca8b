"""`sweeper bench stereo`: accuracy and time of stereo matchers on pairs with true disparity.

Every matcher sees the same pair at 320x240. They take turns within one process, so that their
times are comparable although the machine may be busy.
"""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from robot.bench.stereo.matchers import CLASSICAL, MODELS, Matcher, make_matcher, read_manifest
from robot.bench.stereo.pairs import HEIGHT_PX, WIDTH_PX, TruePair, find_pairs
from robot.errors import DataError
from robot.evaluate.stereo import (
    StereoErrors,
    countable,
    fill_background,
    mean_errors,
    stereo_errors,
)
from robot.evaluate.stereo_kitti import kitti_error_picture

REPEATS = 5
INDOOR = ("middlebury", "eth3d")
Key = tuple[str, str, bool]  # matcher, mask, filled


@dataclass(slots=True)
class _Scores:
    """What was measured for one pair."""

    pair: TruePair
    errors: dict[Key, StereoErrors] = field(default_factory=dict)
    ms: dict[str, float] = field(default_factory=dict)
    over_sgbm: dict[str, float] = field(default_factory=dict)
    disparity: dict[str, np.ndarray] = field(default_factory=dict)


def _time_in_turns(matchers: list[Matcher], pair: TruePair, scores: _Scores) -> None:
    """Run all matchers in turn, several rounds; medians of time and of the ratio to SGBM."""
    rounds: list[dict[str, float]] = []
    for _ in range(REPEATS):
        times: dict[str, float] = {}
        for matcher in matchers:
            began = time.perf_counter()
            found = matcher.match(pair.left, pair.right)
            found_full = fill_background(found) if np.isnan(found).any() else found
            times[matcher.name] = 1e3 * (time.perf_counter() - began)
            scores.disparity[matcher.name] = found
            scores.disparity[matcher.name + " filled"] = found_full
        rounds.append(times)
    for matcher in matchers:
        scores.ms[matcher.name] = statistics.median(t[matcher.name] for t in rounds)
        if any(m.name == "sgbm" for m in matchers):
            ratios = [t[matcher.name] / t["sgbm"] for t in rounds]
            scores.over_sgbm[matcher.name] = statistics.median(ratios)


def _measure(matchers: list[Matcher], pair: TruePair) -> _Scores:
    scores = _Scores(pair)
    _time_in_turns(matchers, pair, scores)
    for matcher in matchers:
        for filled in (False, True):
            found = scores.disparity[matcher.name + (" filled" if filled else "")]
            for mask, pixels in (("all", None), ("noc", pair.visible)):
                key = (matcher.name, mask, filled)
                scores.errors[key] = stereo_errors(found, pair.truth_px, pixels)
    return scores


def _number(value: float, digits: int) -> float | None:
    return round(value, digits) if math.isfinite(value) else None


def _row(
    matcher: Matcher, family: str, pair: str | None, scores: list[_Scores], mask: str, filled: bool
) -> dict[str, Any]:
    errors = mean_errors([s.errors[matcher.name, mask, filled] for s in scores])
    ratios = [s.over_sgbm[matcher.name] for s in scores if matcher.name in s.over_sgbm]
    return {
        "matcher": matcher.name,
        "family": family,
        "pair": pair,
        "mask": mask,
        "filled": filled,
        "density_pct": _number(errors.density_pct, 2),
        "bad1_pct": _number(errors.bad1_pct, 2),
        "bad2_pct": _number(errors.bad2_pct, 2),
        "bad3_pct": _number(errors.bad3_pct, 2),
        "epe_px": _number(errors.epe_px, 3),
        "ms": _number(statistics.median(s.ms[matcher.name] for s in scores), 3),
        "ms_over_sgbm": _number(statistics.median(ratios), 3) if ratios else None,
        "a53_minstr": matcher.a53_minstr,
    }


def _groups(scores: list[_Scores]) -> Iterable[tuple[str, list[_Scores]]]:
    """Families that occur, then "indoor" and "all"."""
    for family in sorted({s.pair.family for s in scores}):
        yield family, [s for s in scores if s.pair.family == family]
    indoor = [s for s in scores if s.pair.family in INDOOR]
    if indoor:
        yield "indoor", indoor
    yield "all", scores


def default_matchers(models: Path = MODELS) -> list[str]:
    """Every network of the manifest that is made for the protocol's size, then the classical."""
    size = (WIDTH_PX, HEIGHT_PX)
    fitting = [
        n["name"]
        for n in read_manifest(models)["networks"]
        if (n.get("width_px"), n.get("height_px")) == size
    ]
    return fitting + list(CLASSICAL)


def bench_stereo(
    pairs_dir: Path,
    matchers: list[str] | None = None,
    out_dir: Path | None = None,
    models: Path = MODELS,
    threads: int = 1,
    error_panels: bool = False,
) -> dict[str, Any]:
    """Measure `matchers` (None: all) on every pair under `pairs_dir`.

    Returns the JSON of `sweeper bench stereo`; with `out_dir`, pictures (left, truth, each
    matcher's filled disparity and, if asked, its errors in KITTI's colours) go there. Raises
    DataError for a folder without pairs and ModelError for an unknown or damaged network.
    """
    names = default_matchers(models) if matchers is None else matchers
    if not names:
        raise DataError("no matcher is given; name at least one, such as hybrid or sgbm.")
    made = [make_matcher(name, models, threads) for name in dict.fromkeys(names)]
    cv2.setNumThreads(threads)
    pairs = find_pairs(pairs_dir)
    for matcher in made:  # the first call allocates and plans
        matcher.match(pairs[0].left, pairs[0].right)
    scores = [_measure(made, pair) for pair in pairs]
    rows: list[dict[str, Any]] = []
    for matcher in made:
        for mask in ("all", "noc"):
            for filled in (False, True):
                for family, group in _groups(scores):
                    rows.append(_row(matcher, family, None, group, mask, filled))
                rows += [
                    _row(matcher, s.pair.family, s.pair.name, [s], mask, filled) for s in scores
                ]
    if out_dir is not None:
        _write_pictures(scores, [m.name for m in made], out_dir, error_panels)
    return {"size": [WIDTH_PX, HEIGHT_PX], "threads": threads, "rows": rows}


def _colour(disparity_px: np.ndarray) -> np.ndarray:
    """Disparity 0..64 px as colour, black where unknown."""
    known = np.isfinite(disparity_px)
    level = np.clip(np.where(known, disparity_px, 0) * 4, 0, 255).astype(np.uint8)
    return cv2.applyColorMap(level, cv2.COLORMAP_TURBO) * known[..., None].astype(np.uint8)


def _write_pictures(scores: list[_Scores], names: list[str], out_dir: Path, errors: bool) -> None:
    """One picture per pair: left | truth | each matcher, filled, and with `errors` its errors."""
    out_dir.mkdir(parents=True, exist_ok=True)
    for s in scores:
        panels = [cv2.cvtColor(s.pair.left, cv2.COLOR_GRAY2BGR), _colour(s.pair.truth_px)]
        for name in names:
            found = s.disparity[name + " filled"]
            panel = _colour(found)
            cv2.putText(panel, name, (4, 14), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (255, 255, 255), 1)
            panels.append(panel)
            if errors:
                truth = np.where(countable(s.pair.truth_px), s.pair.truth_px, np.nan)
                panels.append(kitti_error_picture(found, truth)[..., ::-1])
        cv2.imwrite(str(out_dir / f"{s.pair.family}_{s.pair.name}.png"), np.hstack(panels))


@dataclass(frozen=True, slots=True)
class StereoOrder:
    """What the command line asks for; `way` is protocol, native, stress or confidence."""

    pairs: Path
    matchers: list[str] | None
    out: Path
    error_panels: bool = False
    threads: int = 1
    way: str = "protocol"


def run_order(order: StereoOrder) -> dict[str, Any]:
    """Carry out one order of the command line; see the function of each way."""
    if order.way == "protocol":
        return bench_stereo(
            order.pairs, order.matchers, order.out, MODELS, order.threads, order.error_panels
        )
    from robot.bench.stereo.confidence import bench_confidence
    from robot.bench.stereo.native import bench_native
    from robot.bench.stereo.stress import bench_stress

    ways = {"native": bench_native, "stress": bench_stress, "confidence": bench_confidence}
    names = default_matchers() if order.matchers is None else order.matchers
    return ways[order.way](order.pairs, names, MODELS, order.threads)


def tables(result: dict[str, Any]) -> dict[str, list[dict[str, Any]]]:
    """Title and rows of each table to print: one a family where there are rows per pair."""
    if "rows" not in result:
        return {title: rows for title, rows in result.items() if isinstance(rows, list)}
    means = [row for row in result["rows"] if row["pair"] is None]
    if result["size"] is None:
        said = {"pair", "mask", "size"}
        shown = [{k: v for k, v in row.items() if k not in said} for row in means]
        return {"stereo, native size": shown}
    families = dict.fromkeys(row["family"] for row in means)
    return {f"{family}, gaps filled": _family_table(means, family) for family in families}


def _family_table(means: list[dict[str, Any]], family: str) -> list[dict[str, Any]]:
    """A row a matcher: filled, over all pixels; beside it the density before, and bad-2 of pixels
    that both eyes see."""
    found = {(r["matcher"], r["mask"], r["filled"]): r for r in means if r["family"] == family}
    table = []
    for (matcher, mask, filled), row in found.items():
        if mask != "all" or not filled:
            continue
        short = {f"bad-{n}": row[f"bad{n}_pct"] for n in (1, 2, 3)}
        table.append(
            {
                "matcher": matcher,
                "density": found[matcher, "all", False]["density_pct"],
                **short,
                "EPE": row["epe_px"],
                "bad-2 noc": found[matcher, "noc", True]["bad2_pct"],
                "ms": row["ms"],
                "/ SGBM": row["ms_over_sgbm"],
                "A53 M": row["a53_minstr"],
            }
        )
    return table
