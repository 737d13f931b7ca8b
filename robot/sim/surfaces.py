"""Grey surfaces made from seeds: floors, walls, wood, fabrics.

Every recipe repeats without a seam. Noise is Gaussian with a power spectrum 1/f^(2 beta), made by
shaping white noise in the frequency domain (Saupe, in "The Science of Fractal Images", 1988,
section 2.4), which makes it periodic for free.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np


@dataclass(frozen=True, slots=True, eq=False)
class Texture:
    """A grey uint8 picture and the metres (width, height) that it covers; 0: the whole face."""

    image: np.ndarray
    size_m: tuple[float, float]


@lru_cache(maxsize=8)
def _spectrum(rows: int, columns: int, beta: float, stretch: float) -> np.ndarray:
    """Amplitudes over the frequencies of a real field (rows, columns)."""
    fy = np.fft.fftfreq(rows)[:, None] * rows
    fx = np.fft.rfftfreq(columns)[None, :] * columns * stretch
    weight = 1.0 / np.maximum(np.hypot(fx, fy), 1.0) ** beta
    weight[0, 0] = 0.0
    return weight


def noise(
    rng: np.random.Generator, rows: int, columns: int, beta: float, stretch: float = 1.0
) -> np.ndarray:
    """Seamless noise (rows, columns), mean 0, standard deviation 1; larger `beta` is smoother.

    `stretch` > 1 draws it out along the columns' axis (grain of wood).
    """
    weight = _spectrum(rows, columns, beta, stretch)
    white = np.fft.rfft2(rng.standard_normal((rows, columns)))
    field = np.fft.irfft2(white * weight, s=(rows, columns))
    return field / (field.std() + 1e-9)


def grey(values: np.ndarray) -> np.ndarray:
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)


def grain(rng: np.random.Generator, rows: int, columns: int, mean: float) -> np.ndarray:
    """Grain along the columns' axis: bent growth rings, streaks and pores."""
    bend = noise(rng, rows, columns, 1.8, 6.0)
    y = np.arange(rows)[:, None] / rows
    rings = np.sin(2 * np.pi * (rng.integers(4, 9) * y + 0.9 * bend))
    streaks = noise(rng, rows, columns, 0.7, 24.0)
    pores = noise(rng, rows, columns, 0.2, 10.0)
    return mean * (1.0 + 0.05 * rings + 0.07 * streaks - 0.06 * np.maximum(pores - 1.2, 0.0))


def wood(rng: np.random.Generator) -> Texture:
    return Texture(grey(grain(rng, 512, 512, rng.uniform(120, 165))), (1.2, 0.8))


def dark_wood(rng: np.random.Generator) -> Texture:
    return Texture(grey(grain(rng, 512, 512, rng.uniform(55, 80))), (1.2, 0.8))


def _boards(rng: np.random.Generator, rows: int, lengths: int, mean: float) -> np.ndarray:
    """1024 x 1024 of boards in `rows` rows, `lengths` boards long, joints staggered."""
    size = 1024
    image = np.empty((size, size))
    height, length = size // rows, size // lengths
    strips = [grain(rng, height, size, 1.0) for _ in range(4)]
    for r in range(rows):
        strip = np.roll(strips[r % 4], int(rng.integers(size)), axis=1)
        shift = int(rng.integers(length))
        tone = np.repeat(rng.normal(1.0, 0.08, lengths), length)
        strip = strip * np.roll(tone, shift)
        strip[:2] *= 0.62
        for j in range(lengths):
            x = (j * length + shift) % size
            strip[:, x] *= 0.62
            strip[:, (x + 1) % size] *= 0.8
        image[r * height : (r + 1) * height] = strip
    return mean * image


def planks(rng: np.random.Generator) -> Texture:
    """Floor boards 13 cm wide."""
    return Texture(grey(_boards(rng, 16, 2, rng.uniform(115, 165))), (2.1, 2.1))


def parquet(rng: np.random.Generator) -> Texture:
    """Basket weave of short staves."""
    size, cell = 1024, 128
    image = np.empty((size, size))
    mean = rng.uniform(105, 150)
    for r in range(size // cell):
        for c in range(size // cell):
            block = np.empty((cell, cell))
            for k in range(4):
                stave = 1.0 + 0.05 * noise(rng, cell // 4, cell, 0.8, 8.0)
                stave *= rng.normal(1.0, 0.09)
                stave[0] *= 0.7
                stave[:, 0] *= 0.8
                block[k * cell // 4 : (k + 1) * cell // 4] = stave
            image[r * cell : (r + 1) * cell, c * cell : (c + 1) * cell] = (
                block if (r + c) % 2 else block.T
            )
    return Texture(grey(mean * image), (1.8, 1.8))


def tiles(rng: np.random.Generator) -> Texture:
    """Floor or wall tiles of 30 cm with joints, each tile a little different."""
    size, cell = 1024, 256
    image = np.empty((size, size))
    mean = rng.uniform(140, 190)
    veins = noise(rng, size, size, 1.1)
    for r in range(size // cell):
        for c in range(size // cell):
            part = np.s_[r * cell : (r + 1) * cell, c * cell : (c + 1) * cell]
            tile = (
                mean * rng.normal(1.0, 0.04)
                + 7.0 * np.roll(veins, rng.integers(size, size=2))[part]
            )
            tile[:4] = tile[:, :4] = 0.7 * mean
            image[part] = tile
    return Texture(grey(image + 2.5 * noise(rng, size, size, 0.2)), (1.2, 1.2))


def carpet(rng: np.random.Generator) -> Texture:
    """Short pile with tufts."""
    pile = 14.0 * noise(rng, 512, 512, 0.4) + 6.0 * noise(rng, 512, 512, 1.3)
    return Texture(grey(rng.uniform(85, 140) + pile), (0.8, 0.8))


def plaster(rng: np.random.Generator) -> Texture:
    """A painted wall: nearly plain, slightly mottled by the roller."""
    mottle = 1.6 * noise(rng, 512, 512, 0.6) + 2.2 * noise(rng, 512, 512, 1.6)
    return Texture(grey(rng.uniform(165, 200) + mottle), (2.0, 2.0))


def plain(rng: np.random.Generator) -> Texture:
    """A smooth painted surface: stereo finds nothing on it."""
    return Texture(grey(rng.uniform(150, 200) + 0.6 * noise(rng, 128, 128, 1.8)), (2.0, 2.0))


def black(rng: np.random.Generator) -> Texture:
    """Lacquer that returns next to no light: darker than a camera's noise floor can use."""
    return Texture(grey(10.0 + 0.8 * noise(rng, 128, 128, 1.8)), (1.3, 1.3))


def wallpaper(rng: np.random.Generator) -> Texture:
    """Stripes and sprigs over a rough ground; the tone wanders so that repeats differ."""
    size = 1024
    mean = rng.uniform(145, 190)
    image = mean + 3.0 * noise(rng, size, size, 0.35) + 5.0 * noise(rng, size, size, 1.5)
    x = np.arange(size)[None, :]
    image = image + rng.uniform(2, 9) * np.sign(np.sin(2 * np.pi * x * 8 / size))
    sprig = cv2.GaussianBlur(rng.standard_normal((48, 48)).astype(np.float32), (0, 0), 3.0)
    sprig = (np.abs(sprig) > 1.1 * np.abs(sprig).mean()) * np.hanning(48)[:, None] * np.hanning(48)
    for r in range(16):
        for c in range(8):
            y0, x0 = r * 64 + 8, c * 128 + (64 if r % 2 else 0) + 8
            image[y0 : y0 + 48, x0 : x0 + 48] -= rng.uniform(20, 38) * sprig
    return Texture(grey(image), (2.4, 2.4))


def brick(rng: np.random.Generator) -> Texture:
    """A brick wall, painted over in some seeds."""
    size = 1024
    mean, depth = rng.uniform(110, 180), rng.uniform(0.03, 0.12)
    image = np.full((size, size), 1.0 - 2 * depth)
    for r in range(16):
        for c in range(-1, 4):
            x0, y0 = c * 256 + (128 if r % 2 else 0), r * 64
            tone = rng.normal(1.0, depth)
            image[y0 + 5 : y0 + 64, max(x0 + 5, 0) : max(x0 + 256, 0)] = tone
    rough = 6.0 * noise(rng, size, size, 0.5)
    return Texture(grey(mean * image + rough), (1.0, 1.1))


def fabric(rng: np.random.Generator) -> Texture:
    """Woven upholstery."""
    y, x = np.mgrid[0:512, 0:512]
    weave = 4.0 * (np.sin(x * np.pi / 4) + np.sin(y * np.pi / 4))
    slubs = 5.0 * noise(rng, 512, 512, 0.4, 6.0) + 5.0 * noise(rng, 512, 512, 0.4, 6.0).T
    return Texture(
        grey(rng.uniform(70, 150) + weave + slubs + 6 * noise(rng, 512, 512, 1.4)), (0.6, 0.6)
    )


def leather(rng: np.random.Generator) -> Texture:
    """Wrinkled and dark."""
    wrinkles = np.abs(noise(rng, 512, 512, 0.9))
    return Texture(grey(rng.uniform(45, 90) + 10 * wrinkles), (0.7, 0.7))


def metal(rng: np.random.Generator) -> Texture:
    """Brushed steel of kitchen machines."""
    return Texture(grey(rng.uniform(130, 180) + 4 * noise(rng, 512, 512, 0.5, 30.0)), (0.8, 0.8))
