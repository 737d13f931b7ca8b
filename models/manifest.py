"""`manifest.toml`: which networks there are, what each file must hash to, and the default.

Keys of a `[[networks]]` table: name, file (relative to the manifest), sha256, bytes, width_px,
height_px, max_disparity_px, preprocessing, inputs, outputs, opset, parameters, mmac (millions of
multiply-accumulates per pair), parity_px (largest difference to PyTorch), licence, training_data,
training_batch, training_rate, training_steps, training_minutes, int8 and int8_mean_shift_px (the
layers in 8 bits and how far that moves a disparity in the mean; optional), and a53_minstr (millions
of executed Cortex-A53 instructions, by `make a53`; absent until measured).
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import tomli_w

PREFERRED = ("hybrid", "hybrid_paper")


def read(path: Path) -> dict[str, Any]:
    """The manifest, or an empty one if there is no file yet."""
    if not path.exists():
        return {"default": "", "networks": []}
    return tomllib.loads(path.read_text())


def enter(path: Path, network: dict[str, Any]) -> None:
    """Add a network or replace the one of the same name; the default is the first preferred."""
    present = {n["name"]: n for n in read(path)["networks"]}
    present[network["name"]] = network
    ordered = [
        present[n] for n in (*PREFERRED, *sorted(set(present) - set(PREFERRED))) if n in present
    ]
    rest = {k: v for k, v in read(path).items() if k not in ("default", "networks")}
    path.write_text(tomli_w.dumps({"default": ordered[0]["name"], **rest, "networks": ordered}))


def enter_classical(path: Path, a53_minstr: dict[str, float]) -> None:
    """Set the table `[a53_minstr]`: millions of instructions of matchers without a network."""
    whole = read(path)
    networks = whole.pop("networks")
    path.write_text(tomli_w.dumps({**whole, "a53_minstr": a53_minstr, "networks": networks}))
