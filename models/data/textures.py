"""A bank of grey textures for rendered pairs: procedural, and images from a folder if given.

All of them are uint8 (512, 512). The procedural ones alone are enough to train; a folder of
unpacked texture packages (see `models/README.md`) makes the mix richer.
"""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

SIDE = 512
SKIPPED = (
    "_nm.",
    "_sm.",
    "_norm",
    "_gloss",
    "_bump",
    "_glow",
    "_shirt",
    "_pants",
    "_local",
    "_luma",
    "env/",
)


def value_noise(rng: np.random.Generator, octaves: int, roughness: float) -> np.ndarray:
    """Sum of smooth random fields, float32 (512, 512), about zero mean and unit deviation.

    Octave k has a grid of 2^(k+1) cells and the amplitude roughness^k.
    """
    total = np.zeros((SIDE, SIDE), np.float32)
    for k in range(octaves):
        cells = min(SIDE, 2 ** (k + 1))
        field = rng.standard_normal((cells, cells)).astype(np.float32)
        grown = cv2.resize(field, (SIDE, SIDE), interpolation=cv2.INTER_CUBIC)
        total += grown * np.float32(roughness**k)
    return (total - total.mean()) / (total.std() + 1e-6)


def _noise(rng: np.random.Generator) -> np.ndarray:
    strength, octaves = rng.uniform(10, 50), int(rng.integers(4, 10))
    return 128 + strength * value_noise(rng, octaves, rng.uniform(0.5, 1))


def _tiles(rng: np.random.Generator) -> np.ndarray:
    """Bricks or tiles with joints and a different shade for each stone."""
    wide, high = int(rng.integers(24, 128)), int(rng.integers(16, 96))
    y, x = np.mgrid[0:SIDE, 0:SIDE]
    row = y // high
    x = x + (row % 2) * (wide // 2) * int(rng.integers(0, 2))
    column = x // wide
    shade = rng.normal(0, rng.uniform(2, 25), (SIDE // high + 2, 2 * SIDE // wide + 4))
    image = rng.uniform(60, 200) + shade[row, column]
    joint = (x % wide < rng.integers(1, 6)) | (y % high < rng.integers(1, 6))
    image[joint] += rng.uniform(-60, 60)
    return image + rng.uniform(1, 14) * value_noise(rng, 8, 0.8)


def _wood(rng: np.random.Generator) -> np.ndarray:
    """Long grain along x, with plank joints."""
    grain = cv2.resize(
        rng.standard_normal((SIDE // int(rng.integers(1, 4)), 6)).astype(np.float32),
        (SIDE, SIDE),
        interpolation=cv2.INTER_CUBIC,
    )
    image = rng.uniform(70, 180) + rng.uniform(5, 30) * grain
    plank = int(rng.integers(30, 120))
    image[np.arange(SIDE) % plank < 2] -= rng.uniform(10, 60)
    return image + 6 * value_noise(rng, 7, 0.7)


def _stripes(rng: np.random.Generator) -> np.ndarray:
    """Periodic stripes or checks: the same thing again and again, as on curtains."""
    y, x = np.mgrid[0:SIDE, 0:SIDE].astype(np.float32)
    wave = np.sin(2 * np.pi * x / rng.uniform(10, 80))
    if rng.random() < 0.5:
        wave = wave * np.sin(2 * np.pi * y / rng.uniform(10, 80))
    if rng.random() < 0.6:
        wave = np.sign(wave)
    return 128 + rng.uniform(10, 60) * wave + rng.uniform(2, 20) * value_noise(rng, 8, 0.8)


def _collage(rng: np.random.Generator) -> np.ndarray:
    """Random strokes, discs and letters over noise: posters, shelves, clutter."""
    image = np.clip(_noise(rng), 0, 255).astype(np.uint8)
    for _ in range(int(rng.integers(20, 160))):
        p = tuple(int(v) for v in rng.integers(0, SIDE, 2))
        q = tuple(
            int(np.clip(v + s, 0, SIDE)) for v, s in zip(p, rng.integers(-90, 90, 2), strict=True)
        )
        grey, kind = int(rng.integers(0, 256)), rng.integers(4)
        if kind == 0:
            cv2.rectangle(image, p, q, grey, -1)
        elif kind == 1:
            cv2.circle(image, p, int(rng.integers(2, 40)), grey, -1, cv2.LINE_AA)
        elif kind == 2:
            cv2.line(image, p, q, grey, int(rng.integers(1, 6)), cv2.LINE_AA)
        else:
            word = "".join(chr(c) for c in rng.integers(65, 91, int(rng.integers(2, 9))))
            cv2.putText(image, word, p, int(rng.integers(0, 5)), rng.uniform(0.4, 2), grey, 2)
    return image.astype(np.float32)


def _plain(rng: np.random.Generator) -> np.ndarray:
    """A painted wall: almost nothing to match but slow shading and a little grain."""
    slow = rng.uniform(1, 12) * value_noise(rng, 2, 0.5)
    return rng.uniform(50, 210) + slow + rng.uniform(0.2, 2.5) * value_noise(rng, 9, 0.95)


KINDS: tuple[tuple[Callable[[np.random.Generator], np.ndarray], float], ...] = (
    (_noise, 0.25),
    (_tiles, 0.2),
    (_wood, 0.15),
    (_stripes, 0.1),
    (_collage, 0.2),
    (_plain, 0.1),
)


def procedural(rng: np.random.Generator) -> np.ndarray:
    """One procedural texture, uint8 (512, 512)."""
    makers, weights = zip(*KINDS, strict=True)
    image = makers[int(rng.choice(len(makers), p=np.array(weights)))](rng)
    return np.clip(image, 0, 255).astype(np.uint8)


def _pictures(folder: Path) -> list[tuple[Path, str]]:
    """(file, member or "") of every picture under a folder, also inside .pk3 and .zip archives."""
    suffixes = (".jpg", ".jpeg", ".png", ".tga", ".webp")

    def wanted(name: str) -> bool:
        low = name.lower()
        return low.endswith(suffixes) and not any(s in low for s in SKIPPED)

    found: list[tuple[Path, str]] = []
    for path in sorted(p for p in folder.rglob("*") if p.is_file()):
        if path.suffix.lower() in (".pk3", ".zip"):
            with zipfile.ZipFile(path) as archive:
                found += [(path, name) for name in sorted(archive.namelist()) if wanted(name)]
        elif wanted(path.name):
            found.append((path, ""))
    return found


def _read(path: Path, member: str) -> np.ndarray | None:
    if not member:
        return cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    with zipfile.ZipFile(path) as archive:
        data = np.frombuffer(archive.read(member), np.uint8)
    return cv2.imdecode(data, cv2.IMREAD_GRAYSCALE) if len(data) else None


def from_folder(folder: Path, limit: int, rng: np.random.Generator) -> list[np.ndarray]:
    """Squares cut out of pictures in a folder; pictures without contrast are left out."""
    pictures = _pictures(folder)
    found: list[np.ndarray] = []
    for index in rng.permutation(len(pictures)):
        if len(found) >= limit:
            break
        grey = _read(*pictures[index])
        if grey is None or min(grey.shape) < 200:
            continue
        factor = max(SIDE / min(grey.shape), 0.5 if min(grey.shape) >= 2 * SIDE else 0.0)
        small = cv2.resize(grey, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
        for y in range(0, small.shape[0] - SIDE + 1, SIDE):
            for x in range(0, small.shape[1] - SIDE + 1, SIDE):
                square = small[y : y + SIDE, x : x + SIDE]
                if square.std() > 10:
                    found.append(np.ascontiguousarray(square))
    return found[:limit]


def bank(seed: int, count: int, folder: Path | None = None) -> np.ndarray:
    """uint8 (count, 512, 512): up to three quarters from `folder`, the rest procedural."""
    rng = np.random.default_rng(seed)
    found = from_folder(folder, count * 3 // 4, rng) if folder is not None else []
    return np.stack(found + [procedural(rng) for _ in range(count - len(found))])
