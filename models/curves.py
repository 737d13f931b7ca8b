"""Pictures of a training, and of what accuracy costs.

`python -m models.curves training/hybrid` draws `curve.png` out of `log.jsonl` at any time.
`python -m models.curves --bench bench.json --family indoor` draws `models/cost.png`: the errors of
every network and classical matcher that `sweeper bench stereo --json` measured, over the executed
Cortex-A53 instructions that stand in the manifest.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot

from models import manifest

HERE = Path(__file__).resolve().parent


def draw_training(folder: Path) -> None:
    """Write `curve.png`: loss, and end-point error on held-back pairs, over minutes trained."""
    lines = _lasting(map(json.loads, (folder / "log.jsonl").read_text().splitlines()))
    figure, (above, below) = pyplot.subplots(2, 1, sharex=True, figsize=(8, 6))
    curves = {"loss": above} | {
        key: below for line in lines for key in line if key.endswith("epe_px")
    }
    for key, axes in curves.items():
        points = [(line["trained_s"] / 60, line[key]) for line in lines if key in line]
        axes.plot(*zip(*points, strict=True), label=key.replace("_epe_px", ", EPE px"))
    for axes in (above, below):
        axes.legend()
        axes.grid(alpha=0.3)
    below.set_xlabel("minutes trained")
    _save(figure, folder / "curve.png")


def _lasting(lines: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    """Without what was done again after an interruption: the later lines replace it."""
    kept: list[dict[str, Any]] = []
    for line in lines:
        while kept and kept[-1]["trained_s"] > line["trained_s"]:
            kept.pop()
        kept.append(line)
    return kept


def draw_cost(rows: list[dict[str, Any]], minstr: dict[str, float], path: Path) -> None:
    """Points (instructions in millions, bad-2 and bad-3 in %), named; one colour a measure.

    `rows` are the means of a family, as `sweeper bench stereo --json` writes them.
    """
    figure, axes = pyplot.subplots(figsize=(8, 5))
    for key, title, mark in (("bad2_pct", "bad-2", "o"), ("bad3_pct", "bad-3", "s")):
        known = sorted((minstr[r["matcher"]], r[key]) for r in rows if r["matcher"] in minstr)
        if known:
            axes.scatter(*zip(*known, strict=True), marker=mark, label=title)
    for row in rows:
        if row["matcher"] in minstr:
            place = (minstr[row["matcher"]], row["bad2_pct"])
            axes.annotate(row["matcher"], place, (0, 7), textcoords="offset points", ha="center")
    axes.set_xscale("log")
    axes.set_xlabel("executed Cortex-A53 instructions per pair, millions")
    axes.set_ylabel("wrong pixels, %")
    axes.margins(0.12)
    axes.set_ylim(bottom=0)
    axes.legend()
    axes.grid(alpha=0.3, which="both")
    _save(figure, path)


def instructions(models: Path = HERE) -> dict[str, float]:
    """Millions of executed instructions by matcher, from the manifest."""
    listed = manifest.read(models / "manifest.toml")
    networks = {n["name"]: n["a53_minstr"] for n in listed["networks"] if "a53_minstr" in n}
    return {**listed.get("a53_minstr", {}), **networks}


def _save(figure: Any, path: Path) -> None:
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    pyplot.close(figure)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("training", type=Path, nargs="?", help="folder of one training")
    parser.add_argument("--bench", type=Path, help="JSON of sweeper bench stereo")
    parser.add_argument("--family", default="indoor")
    given = parser.parse_args()
    if given.training is not None:
        draw_training(given.training)
    if given.bench is not None:
        rows = [
            r
            for r in json.loads(given.bench.read_text())["rows"]
            if r["pair"] is None and r["filled"] and r["mask"] == "all"
            and r["family"] == given.family
        ]  # fmt: skip
        draw_cost(rows, instructions(), HERE / "cost.png")


if __name__ == "__main__":
    main()
