"""Photographs with true disparity as shards: `python -m models.data.real --pairs DIR`.

For people who have KITTI 2012 or 2015, Middlebury, ETH3D or Scene Flow, in their own layouts. None
of the networks that ship saw any of them; their licences forbid it or leave it unclear.

Every pair gives `--views` windows: of a random size between half of the picture and all of it, four
by three, brought to 320x240 with its disparities. `--paper-crop` takes windows of 512x256 out of
the lower two thirds instead, unscaled, as the paper trains.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from models.data.shards import encode_disparity, write_shard
from robot.bench.stereo.pairs import HEIGHT_PX, WIDTH_PX, TruePair, as_it_is, each_pair, read_pfm

PAPER_WIDTH, PAPER_HEIGHT = 512, 256
View = tuple[np.ndarray, np.ndarray, np.ndarray]


def scene_flow_pairs(folder: Path) -> Iterator[TruePair]:
    """FlyingThings3D, Driving and Monkaa: `frames_cleanpass/.../left/N.png`, right beside it, and
    `disparity/.../left/N.pfm`."""
    for path in sorted(folder.rglob("frames_*pass/**/left/*.png")):
        parts = list(path.parts)
        at = next(i for i, p in enumerate(parts) if p.startswith("frames_") and p.endswith("pass"))
        truth_path = Path(*parts[:at], "disparity", *parts[at + 1 :]).with_suffix(".pfm")
        other = path.parent.parent / "right" / path.name
        if not truth_path.exists() or not other.exists():
            continue
        truth = np.abs(read_pfm(truth_path))
        left, right = (cv2.imread(str(p), cv2.IMREAD_GRAYSCALE) for p in (path, other))
        yield as_it_is(path.stem, "sceneflow", left, right, truth, np.isfinite(truth))


def any_pairs(folder: Path) -> Iterator[TruePair]:
    """The pairs of every known layout under a folder."""
    yield from each_pair(folder, as_it_is)
    yield from scene_flow_pairs(folder)


def window(rng: np.random.Generator, pair: TruePair) -> View:
    """A random window, four by three, at 320x240: both eyes uint8 and disparity px, NaN unknown."""
    height, width = pair.left.shape
    largest = min(height, width * 3 / 4)
    high = int(largest * rng.uniform(0.5, 1.0))
    wide = high * 4 // 3
    y, x = int(rng.integers(0, height - high + 1)), int(rng.integers(0, width - wide + 1))
    size, area = (WIDTH_PX, HEIGHT_PX), (slice(y, y + high), slice(x, x + wide))
    kind = cv2.INTER_AREA if wide >= WIDTH_PX else cv2.INTER_LINEAR
    left, right = (cv2.resize(e[area], size, interpolation=kind) for e in (pair.left, pair.right))
    truth = cv2.resize(pair.truth_px[area], size, interpolation=cv2.INTER_NEAREST)
    return left, right, truth * np.float32(WIDTH_PX / wide)


def paper_crop(rng: np.random.Generator, pair: TruePair) -> View | None:
    """512x256 out of the lower two thirds, unscaled; None if the picture is too small."""
    height, width = pair.left.shape
    top = height // 3
    if height - top < PAPER_HEIGHT or width < PAPER_WIDTH:
        top = height - PAPER_HEIGHT
    if top < 0 or width < PAPER_WIDTH:
        return None
    y = int(rng.integers(top, height - PAPER_HEIGHT + 1))
    x = int(rng.integers(0, width - PAPER_WIDTH + 1))
    area = (slice(y, y + PAPER_HEIGHT), slice(x, x + PAPER_WIDTH))
    return pair.left[area], pair.right[area], pair.truth_px[area]


def views(rng: np.random.Generator, folder: Path, each: int, paper: bool) -> Iterator[View]:
    """`each` windows of every pair under a folder."""
    for pair in any_pairs(folder):
        for _ in range(each):
            made = paper_crop(rng, pair) if paper else window(rng, pair)
            if made is not None:
                yield made


def write_shards(out: Path, seed: int, found: Iterator[View], size: int) -> int:
    """Shards `real-<seed>-<n>` of `size` windows each; returns the number of windows."""
    out.mkdir(parents=True, exist_ok=True)
    held: list[View] = []
    count = shard = 0

    def write() -> None:
        images = np.stack([np.stack(v[:2]) for v in held])
        codes = np.stack([encode_disparity(v[2]) for v in held])
        write_shard(out / f"real-{seed}-{shard:04d}", images, codes)

    for view in found:
        held.append(view)
        count += 1
        if len(held) == size:
            write()
            held, shard = [], shard + 1
    if held:
        write()
    return count


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--pairs", type=Path, required=True, metavar="DIR")
    parser.add_argument("--out", type=Path, default=Path("training/pairs"))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--views", type=int, default=8, help="windows of each pair")
    parser.add_argument("--shard", type=int, default=256, help="windows in a shard")
    parser.add_argument("--paper-crop", action="store_true")
    given = parser.parse_args()
    rng = np.random.default_rng(given.seed)
    found = views(rng, given.pairs, given.views, given.paper_crop)
    count = write_shards(given.out, given.seed, found, given.shard)
    if not count:
        raise SystemExit(f"{given.pairs} holds no pair of a known layout; see models/README.md")
    print(f"{count} windows")


if __name__ == "__main__":
    main()
