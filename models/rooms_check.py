"""What the robot needs: `python -m models.rooms_check --json rooms.json`.

Rendered rooms that no training has seen (other seeds), through the robot's own eyes (228 px, 6 cm,
9 cm above the floor), photographed with noise, blur and unequal exposure. At 3 m the disparity is
4.6 px, so bad-3 says little; depth does: the median of |z - z_true| / z_true between 0.5 and 3 m,
and bad-1 there, of dense maps (SGBM's gaps filled as in the bench).
"""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from models.data import textures
from models.data.photometry import photograph
from models.data.rooms import ROBOT_BASELINE_M, ROBOT_FOCAL_PX, RoomRenderer
from robot.bench.stereo.matchers import Matcher, make_matcher
from robot.evaluate.stereo import fill_background

NEAR_M, FAR_M = 0.5, 3.0
SEED, TEXTURES = 20_011, 120  # neither seed is used by the shards of the cards


@dataclass(frozen=True, slots=True, eq=False)
class RoomPair:
    """Both photographs, uint8 (240, 320), and the true disparity, px, NaN unknown."""

    left: np.ndarray
    right: np.ndarray
    truth_px: np.ndarray


def room_pairs(count: int, seed: int = SEED, folder: Path | None = None) -> list[RoomPair]:
    """`count` pairs of as many rooms as it takes."""
    renderer = RoomRenderer(textures.bank(seed, TEXTURES, folder))
    found: list[RoomPair] = []
    room = 0
    while len(found) < count:
        rng = np.random.default_rng((seed, room))
        for left, right, disparity in renderer.robot_pairs(rng):
            found.append(RoomPair(*photograph(rng, left, right), disparity))
        room += 1
    return found[:count]


def depth_errors(disparity_px: np.ndarray, truth_px: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """|z - z_true| / z_true and |d - d_true| px of the pixels from 0.5 to 3 m; inf if empty."""
    scale = ROBOT_FOCAL_PX * ROBOT_BASELINE_M
    with np.errstate(invalid="ignore"):
        counted = (truth_px >= scale / FAR_M) & (truth_px <= scale / NEAR_M)
    found, truth = disparity_px[counted].astype(np.float64), truth_px[counted]
    there = np.isfinite(found) & (found > 0)
    safe = np.where(there, found, 1.0)
    relative = np.where(there, np.abs(truth / safe - 1), np.inf)
    return relative, np.where(there, np.abs(found - truth), np.inf)


def measure(matcher: Matcher, pairs: list[RoomPair]) -> dict[str, Any]:
    """Median relative depth error and bad-1 over all counted pixels of all pairs, in percent."""
    relative, off = [], []
    for pair in pairs:
        found = matcher.match(pair.left, pair.right)
        dense = fill_background(found) if np.isnan(found).any() else found
        one, other = depth_errors(dense, pair.truth_px)
        relative.append(one)
        off.append(other)
    return {
        "matcher": matcher.name,
        "median_depth_error_pct": round(100 * float(np.median(np.concatenate(relative))), 2),
        "bad1_pct": round(100 * float((np.concatenate(off) > 1).mean()), 2),
        "pairs": len(pairs),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--matcher", default="hybrid,hybrid_paper,sgbm", help="comma-separated")
    parser.add_argument("--pairs", type=int, default=100)
    parser.add_argument("--textures", type=Path, help="folder of pictures, as for the shards")
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    cv2.setNumThreads(1)
    pairs = room_pairs(given.pairs, folder=given.textures)
    rows = [measure(make_matcher(name), pairs) for name in given.matcher.split(",")]
    for row in rows:
        print("  ".join(f"{key} {value}" for key, value in row.items()))
    if given.json is not None:
        given.json.write_text(json.dumps({"rooms": rows}, indent=1))


if __name__ == "__main__":
    main()
