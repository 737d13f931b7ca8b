"""Batches for training out of shards on disk, and what is done to both eyes alike."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from models.data.shards import decode_disparity

CROP = (192, 256)
ZOOMED = 0.5  # share of the pairs that are resized to the crop's size
SMALLEST = 0.7  # side of the smallest window that is enlarged to it


class Shards:
    """The shards of one kind in a folder, memory-mapped; `rescan` finds those that came since."""

    def __init__(self, folder: Path, kind: str) -> None:
        self.folder, self.kind = folder, kind
        self.images: dict[str, np.ndarray] = {}
        self.disparities: dict[str, np.ndarray] = {}
        self.rescan()

    def rescan(self) -> int:
        """Open new shards; returns the number of pairs."""
        for path in sorted(self.folder.glob(f"{self.kind}-*.images.npy")):
            stem = path.name.removesuffix(".images.npy")
            if stem not in self.images:
                self.images[stem] = np.load(path, mmap_mode="r")
                self.disparities[stem] = np.load(
                    self.folder / f"{stem}.disparity.npy", mmap_mode="r"
                )
        return sum(len(i) for i in self.images.values())

    def pick(self, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """One pair at random: images uint8 (2, h, w) and disparity codes uint16 (h, w)."""
        stem = sorted(self.images)[int(rng.integers(len(self.images)))]
        index = int(rng.integers(len(self.images[stem])))
        return self.images[stem][index], self.disparities[stem][index]

    def everything(self) -> tuple[np.ndarray, np.ndarray]:
        """All pairs: images uint8 (n, 2, h, w) and disparity float32 (n, h, w), NaN unknown."""
        stems = sorted(self.images)
        codes = np.concatenate([self.disparities[s] for s in stems])
        return np.concatenate([self.images[s] for s in stems]), decode_disparity(codes)


def augment(
    rng: np.random.Generator, images: np.ndarray, disparity: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Random window, flip and exposure, equal for both eyes: float32 grey 0..255 and px.

    Some windows are resized, across and along by different factors: disparity grows with width.
    """
    height, width = CROP
    if rng.random() < ZOOMED:
        height = int(rng.uniform(SMALLEST * height, images.shape[1]))
        width = int(rng.uniform(SMALLEST * width, images.shape[2]))
    top = int(rng.integers(0, images.shape[1] - height + 1))
    start = int(rng.integers(0, images.shape[2] - width + 1))
    window = (slice(top, top + height), slice(start, start + width))
    grey: np.ndarray = images[:, window[0], window[1]].astype(np.float32)
    truth = disparity[window]
    if (height, width) != CROP:
        grey = np.stack([cv2.resize(eye, CROP[::-1]) for eye in grey])
        scale = np.float32(CROP[1] / width)
        truth = scale * cv2.resize(truth, CROP[::-1], interpolation=cv2.INTER_NEAREST)
    if rng.random() < 0.25:
        grey, truth = grey[:, ::-1], truth[::-1]
    if rng.random() < 0.4:
        grey = 255 * (grey / 255) ** np.float32(np.exp(rng.uniform(-0.5, 0.5)))
    if rng.random() < 0.15:
        grey = 255 - grey
    gain, offset = np.exp(rng.uniform(-0.4, 0.4)), rng.uniform(-30, 30)
    return np.clip(grey * np.float32(gain) + np.float32(offset), 0, 255), truth


def batch(seed: int, step: int, kinds: list[Shards], size: int) -> tuple[np.ndarray, np.ndarray]:
    """Batch number `step`: grey (size, 2, 192, 256) 0..255 and disparity (size, 1, 192, 256) px.

    The kinds take turns, so that each has an equal share however many pairs it holds.
    """
    rng = np.random.default_rng((seed, step))
    present = [k for k in kinds if k.images]
    images, truths = [], []
    for i in range(size):
        image, code = present[(i + step) % len(present)].pick(rng)
        grey, truth = augment(rng, image, decode_disparity(code))
        images.append(grey)
        truths.append(truth[None])
    return np.stack(images), np.stack(truths)
