"""Write shards of rendered pairs: `python -m models.data.shards --kind shapes --seed 1 ...`.

A shard is two files, `<kind>-<seed>-<n>.images.npy` uint8 (pairs, 2, 240, 320) and
`<kind>-<seed>-<n>.disparity.npy` uint16 (pairs, 240, 320) in 1/256 px, where 65535 means unknown.
Both appear under their names only when complete, so that training may start on the first one.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from models.data import textures
from models.data.photometry import photograph
from models.data.shapes import shapes_pair

UNKNOWN = 65535
Pair = tuple[np.ndarray, np.ndarray, np.ndarray]
Maker = Callable[[np.random.Generator], list[Pair]]


def encode_disparity(disparity_px: np.ndarray) -> np.ndarray:
    """Disparity in px (NaN unknown, < 255) to uint16 in 1/256 px."""
    known = np.isfinite(disparity_px) & (disparity_px < 255)
    return np.where(known, np.rint(np.nan_to_num(disparity_px) * 256), UNKNOWN).astype(np.uint16)


def decode_disparity(code: np.ndarray) -> np.ndarray:
    """The inverse of `encode_disparity`: float32 px with NaN."""
    return np.where(code == UNKNOWN, np.float32(np.nan), code.astype(np.float32) / 256)


def make_shard(rng: np.random.Generator, pairs: Maker, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Render `count` pairs and take their photographs."""
    images: list[np.ndarray] = []
    disparities: list[np.ndarray] = []
    while len(images) < count:
        for left, right, disparity in pairs(rng):
            images.append(np.stack(photograph(rng, left, right)))
            disparities.append(encode_disparity(disparity))
    return np.stack(images[:count]), np.stack(disparities[:count])


def write_shard(stem: Path, images: np.ndarray, disparities: np.ndarray) -> None:
    """Save both files and move them to their names, the images last."""
    for array, suffix in ((disparities, ".disparity.npy"), (images, ".images.npy")):
        partial = stem.with_name(stem.name + suffix + ".partial")
        with partial.open("wb") as file:
            np.save(file, array)
        partial.replace(stem.with_name(stem.name + suffix))


def maker(kind: str, seed: int, texture_folder: Path | None, texture_count: int) -> Maker:
    """The function that renders a few pairs of a kind: "shapes" or "rooms"."""
    bank = textures.bank(seed, texture_count, texture_folder)
    if kind == "shapes":
        return lambda rng: [shapes_pair(rng, bank)]
    from models.data.rooms import RoomRenderer

    return RoomRenderer(bank).pairs


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--kind", choices=("shapes", "rooms"), default="shapes")
    parser.add_argument("--out", type=Path, default=Path("training/pairs"))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--shards", type=int, default=40)
    parser.add_argument("--pairs", type=int, default=256, help="pairs in a shard")
    parser.add_argument("--textures", type=Path, help="folder of pictures with a free licence")
    parser.add_argument("--texture-count", type=int, default=600)
    order = parser.parse_args()
    cv2.setNumThreads(1)
    order.out.mkdir(parents=True, exist_ok=True)
    pairs = maker(order.kind, order.seed, order.textures, order.texture_count)
    for n in range(order.shards):
        began = time.monotonic()
        rng = np.random.default_rng((order.seed, n))
        images, disparities = make_shard(rng, pairs, order.pairs)
        write_shard(order.out / f"{order.kind}-{order.seed}-{n:04d}", images, disparities)
        rate = order.pairs / (time.monotonic() - began)
        print(f"{order.kind} shard {n + 1}/{order.shards}, {rate:.1f} pairs/s", flush=True)


if __name__ == "__main__":
    main()
