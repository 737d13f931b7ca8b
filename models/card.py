"""The model card of a network: `python -m models.card hybrid --bench bench.json`.

Every figure is taken from a file that a command wrote: the manifest (export), the training log
and the JSON of `sweeper bench stereo`. Nothing is typed in by hand.
"""

from __future__ import annotations

import argparse
import importlib
import json
from pathlib import Path
from typing import Any

from models import manifest
from models.networks import WIDTHS, module_of

HERE = Path(__file__).resolve().parent
FAMILIES = ("indoor", "kitti2015", "all")
TEXT = """# {name}

{what}

Input: `left`, `right`, float32 (1, 1, {height_px}, {width_px}), {preprocessing}, a rectified pair.
Output: `disparity` float32 (1, 1, {height_px}, {width_px}), px at input size, {dense},
0 to about {max_disparity_px}; `confidence`, the same shape, 0 to 1: the network's own guess that it
is right to 2 px. Layer by layer: the head of `{definition}`.

| | | from |
|---|---|---|
| parameters | {parameters:,} | `python -m models.export {name}{int8_option}` |
| file | {bytes:,} bytes, opset {opset}, sha256 `{sha}...` | the same |
| multiply-accumulates | {mmac} M per pair | the same |
| difference to PyTorch | {parity_px:g} px at most, on one random pair{int8_note} | the same |
| executed Cortex-A53 instructions | {a53} | `make a53` |
| trained | {steps} | `python -m models.train {name}{start_option} --minutes {minutes:g}` |
| licence | {licence} | |

## Data

{training_data}, made by `python -m models.data.shards` (floating shapes; furnished rooms and
floating boxes on the simulator's rasteriser), 320x240, 0.5 to 63 px, with blur, noise, different
exposure and gamma of the eyes, reflections and up to 1 px of vertical misalignment. Textures:
procedural, and at training time pictures of the Debian packages nexuiz-textures, ufoai-textures and
plasma-workspace-wallpapers (GPL-2+; parts CC-BY-3.0, CC-BY-SA-3.0 or public domain, as their
copyright files say), none of which is part of this repository. No photograph with true disparity
was used for training or for choosing weights.

AdamW, batch {training_batch} of 192x256, rate {training_rate:g} with warm-up and half a cosine,
bfloat16 autocast. Loss: smooth L1 of the final and the coarse disparities{extra},
and the confidence. Kept: the weights with the least end-point error on 64 + 64 held-back rendered
pairs (other seeds and textures).

| held-back rendered pairs | EPE px | bad-1 % | bad-2 % | bad-3 % |
|---|---|---|---|---|
{validation}

## Measured on real photographs

Middlebury and ETH3D ("indoor") and KITTI 2015, at 320x240, all pixels with truth, every matcher
dense (SGBM and BM with KITTI's background fill), means over {pairs} pairs, one thread, x86-64, all
matchers in turn in one process. Command: `sweeper bench stereo --pairs DIR --json bench.json`.

| matcher | family | bad-1 % | bad-2 % | bad-3 % | EPE px | ms / SGBM's |
|---|---|---|---|---|---|---|
{table}

{verdict}
{more}
## Limits

- Made for grey, rectified, horizontal pairs of 240x320 with disparities of 0 to 63 px; nearer
  things come out too far.
- Trained on rendered pairs only, on one processor core.
- Guesses where only one eye sees: at the left border and beside outlines.
- Mirrors, glass and large plain walls are guessed from their surroundings.
"""


def _validation(folder: Path) -> str:
    """Rows of the check that was kept: the one with the least sum of end-point errors."""
    lines = [json.loads(line) for line in (folder / "log.jsonl").read_text().splitlines()]
    checks = [line for line in lines if any(k.endswith("epe_px") for k in line)]
    best = min(checks, key=lambda c: sum(v for k, v in c.items() if k.endswith("epe_px")))
    kinds = [k.removesuffix("_epe_px") for k in best if k.endswith("epe_px")]
    return "\n".join(
        f"| {kind} (step {best['step']}) | {best[kind + '_epe_px']:.2f} | "
        + " | ".join(f"{best[f'{kind}_bad{n}_pct']:.1f}" for n in (1, 2, 3))
        + " |"
        for kind in kinds
    )


def _rows(bench: dict[str, Any]) -> list[dict[str, Any]]:
    return [
        r
        for r in bench["rows"]
        if r["pair"] is None and r["mask"] == "all" and r["filled"] and r["family"] in FAMILIES
    ]


def _table(bench: dict[str, Any]) -> str:
    return "\n".join(
        f"| {r['matcher']} | {r['family']} | {r['bad1_pct']:.1f} | {r['bad2_pct']:.1f} | "
        f"{r['bad3_pct']:.1f} | {r['epe_px']:.2f} | {r['ms_over_sgbm']:.2f} |"
        for r in _rows(bench)
    )


def _dense(name: str, bench: dict[str, Any]) -> str:
    """Whether it says something of every pixel."""
    shares = [
        r["density_pct"]
        for r in bench["rows"]
        if r["matcher"] == name and r["pair"] is None and not r["filled"] and r["family"] == "all"
    ]
    return "dense" if min(shares, default=100.0) > 99.0 else "NaN where its own check fails"


def _verdict(name: str, bench: dict[str, Any]) -> str:
    """Accuracy against SGBM in the paper's sense: ratio of 100 - bad-3."""
    parts = []
    for family in FAMILIES:
        found = {r["matcher"]: r for r in _rows(bench) if r["family"] == family}
        if name in found and "sgbm" in found:
            ours, theirs = (100 - found[m]["bad3_pct"] for m in (name, "sgbm"))
            parts.append(f"{100 * ours / theirs:.1f} % ({family})")
    return f"Accuracy, 100 - bad-3, as a share of fair SGBM's: {', '.join(parts)}."


def _int8_note(entry: dict[str, Any]) -> str:
    """What 8 bits change, or nothing."""
    if "int8" not in entry:
        return ""
    return (
        f", before the layers {entry['int8']!r} went to 8 bits, which moves disparities by "
        f"{entry['int8_mean_shift_px']:g} px in the mean of 24 rendered pairs"
    )


MORE = {
    "confidence": "The surest pixels, as many as SGBM keeps (`sweeper bench stereo --confidence`)",
    "stress": "Disturbed pictures, dense maps, growth in points (`sweeper bench stereo --stress`)",
    "swapped": "Pixels believed (confidence 0.5 or more), eyes right and swapped (the same)",
    "rooms": "Rendered rooms through the robot's eyes, 0.5 to 3 m (`python -m models.rooms_check`)",
}


def more_tables(name: str, results: list[dict[str, Any]]) -> str:
    """Tables of other commands' JSON: the rows of this network and of SGBM."""
    parts = []
    for title, rows in ((t, r) for result in results for t, r in result.items() if t in MORE):
        chosen = [r for r in rows if r["matcher"] in (name, "sgbm")]
        if not any(r["matcher"] == name for r in chosen):
            continue
        keys = list(chosen[0])
        lines = ["| " + " | ".join(k.replace("_pct", " %").replace("_", " ") for k in keys) + " |"]
        lines.append("|" + "---|" * len(keys))
        lines += ["| " + " | ".join(str(r[k]) for k in keys) + " |" for r in chosen]
        parts.append(f"\n{MORE[title]}:\n\n" + "\n".join(lines) + "\n")
    return "".join(parts)


def _first_line(text: str) -> str:
    """First line of a module's docstring, without the leading name."""
    what = text.split("\n")[0].split(": ", 1)[1]
    return what[0].upper() + what[1:]


def card(
    name: str, bench: dict[str, Any], training: Path, models: Path = HERE,
    more: tuple[dict[str, Any], ...] = (),
) -> str:  # fmt: skip
    """The text of the card of one network of the manifest."""
    entry = next(
        n for n in manifest.read(models / "manifest.toml")["networks"] if n["name"] == name
    )
    module = importlib.import_module(module_of(name))
    a53 = entry.get("a53_minstr")
    data = entry["training_data"]
    return TEXT.format(
        **{**entry, "training_data": data[0].upper() + data[1:]},
        what="`hybrid` in another width." if name in WIDTHS else _first_line(module.__doc__ or ""),
        sha=entry["sha256"][:16],
        a53="not measured" if a53 is None else f"{a53} M per pair",
        definition=module_of(name).replace(".", "/") + ".py",
        int8_note=_int8_note(entry),
        int8_option=f" --int8 '{entry['int8']}'" if "int8" in entry else "",
        steps=f"{entry['training_steps']} steps in {entry['training_minutes']} minutes "
        "on shared CPU cores",
        minutes=round(entry["training_minutes"]),
        start_option=f" --start {entry['training_start']}" if "training_start" in entry else "",
        extra=", cross-entropy of the shift scores" if name != "hybrid_paper" else "",
        validation=_validation(training),
        pairs=len({(r["family"], r["pair"]) for r in bench["rows"] if r["pair"]}),
        table=_table(bench),
        dense=_dense(name, bench),
        verdict=_verdict(name, bench),
        more=more_tables(name, list(more)),
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("name")
    parser.add_argument("--bench", type=Path, required=True, help="JSON of sweeper bench stereo")
    parser.add_argument("--more", type=Path, nargs="*", default=[], help="JSON of other commands")
    given = parser.parse_args()
    more = tuple(json.loads(path.read_text()) for path in given.more)
    bench = json.loads(given.bench.read_text())
    text = card(given.name, bench, Path("training") / given.name, more=more)
    path = HERE / "artifacts" / f"{given.name}.md"
    path.write_text(text)
    print(path)


if __name__ == "__main__":
    main()
