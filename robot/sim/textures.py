"""Grey textures made from seeds: floors, walls, fabrics, wood, books, pictures.

Every recipe repeats without a seam. Noise is Gaussian with a power spectrum 1/f^(2 beta), made by
shaping white noise in the frequency domain (Saupe, in "The Science of Fractal Images", 1988,
section 2.4), which makes it periodic for free.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from robot.errors import SceneError


@dataclass(frozen=True, slots=True, eq=False)
class Texture:
    """A grey uint8 picture and the metres (width, height) that it covers; 0: the whole face."""

    image: np.ndarray
    size_m: tuple[float, float]


def noise(
    rng: np.random.Generator, rows: int, columns: int, beta: float, stretch: float = 1.0
) -> np.ndarray:
    """Seamless noise (rows, columns), mean 0, standard deviation 1; larger `beta` is smoother.

    `stretch` > 1 draws it out along the columns' axis (grain of wood).
    """
    fy = np.fft.fftfreq(rows)[:, None] * rows
    fx = np.fft.rfftfreq(columns)[None, :] * columns * stretch
    weight = 1.0 / np.maximum(np.hypot(fx, fy), 1.0) ** beta
    weight[0, 0] = 0.0
    white = np.fft.rfft2(rng.standard_normal((rows, columns)))
    field = np.fft.irfft2(white * weight, s=(rows, columns))
    return field / (field.std() + 1e-9)


def _grey(values: np.ndarray) -> np.ndarray:
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)


def _wood(rng: np.random.Generator, rows: int, columns: int, mean: float) -> np.ndarray:
    """Grain along the columns' axis: bent growth rings, streaks and pores."""
    bend = noise(rng, rows, columns, 1.8, 6.0)
    y = np.arange(rows)[:, None] / rows
    rings = np.sin(2 * np.pi * (rng.integers(4, 9) * y + 0.9 * bend))
    streaks = noise(rng, rows, columns, 0.7, 24.0)
    pores = noise(rng, rows, columns, 0.2, 10.0)
    return mean * (1.0 + 0.05 * rings + 0.07 * streaks - 0.06 * np.maximum(pores - 1.2, 0.0))


def wood(rng: np.random.Generator) -> Texture:
    return Texture(_grey(_wood(rng, 512, 512, rng.uniform(120, 165))), (1.2, 0.8))


def dark_wood(rng: np.random.Generator) -> Texture:
    return Texture(_grey(_wood(rng, 512, 512, rng.uniform(55, 80))), (1.2, 0.8))


def _boards(rng: np.random.Generator, rows: int, lengths: int, mean: float) -> np.ndarray:
    """1024 x 1024 of boards in `rows` rows, `lengths` boards long, joints staggered."""
    size = 1024
    image = np.empty((size, size))
    height, length = size // rows, size // lengths
    grain = [_wood(rng, height, size, 1.0) for _ in range(4)]
    for r in range(rows):
        strip = np.roll(grain[r % 4], int(rng.integers(size)), axis=1)
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
    return Texture(_grey(_boards(rng, 16, 2, rng.uniform(115, 165))), (2.1, 2.1))


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
    return Texture(_grey(mean * image), (1.8, 1.8))


def tiles(rng: np.random.Generator) -> Texture:
    """Floor or wall tiles of 30 cm with joints, each tile a little different."""
    size, cell = 1024, 256
    image = np.empty((size, size))
    mean = rng.uniform(140, 190)
    veins = noise(rng, size, size, 1.1)
    for r in range(size // cell):
        for c in range(size // cell):
            part = np.s_[r * cell : (r + 1) * cell, c * cell : (c + 1) * cell]
            tile = mean * rng.normal(1.0, 0.04) + 7.0 * np.roll(veins, rng.integers(size, size=2))[part]
            tile[:4] = tile[:, :4] = 0.7 * mean
            image[part] = tile
    return Texture(_grey(image + 2.5 * noise(rng, size, size, 0.2)), (1.2, 1.2))


def carpet(rng: np.random.Generator) -> Texture:
    """Short pile with tufts."""
    pile = 14.0 * noise(rng, 512, 512, 0.4) + 6.0 * noise(rng, 512, 512, 1.3)
    return Texture(_grey(rng.uniform(85, 140) + pile), (0.8, 0.8))


def oriental(rng: np.random.Generator) -> Texture:
    """A patterned rug: frames and medallions, symmetric about both axes; covers its face."""
    half = cv2.resize(noise(rng, 64, 64, 0.9).astype(np.float32), (256, 256))
    quarter = np.digitize(half, [-0.8, -0.2, 0.3, 0.9]) / 4.0
    levels = rng.permutation(np.linspace(0.0, 1.0, 5))
    y, x = np.mgrid[0:256, 0:256]
    edge = np.minimum(x, y)
    quarter = np.where(edge < 46, levels[(edge // 9) % 5], quarter)
    figures = np.sin(x / 5.0) * np.sin(y / 5.0) > 0.3
    quarter = np.where((edge > 14) & (edge < 34) & figures, 1.0 - quarter, quarter)
    half = np.concatenate([quarter, quarter[:, ::-1]], axis=1)
    image = np.concatenate([half, half[::-1]], axis=0)
    return Texture(_grey(60 + 120 * image + 8 * noise(rng, 512, 512, 0.3)), (0.0, 0.0))


def plaster(rng: np.random.Generator) -> Texture:
    """A painted wall: nearly plain, slightly mottled by the roller."""
    mottle = 1.6 * noise(rng, 512, 512, 0.6) + 2.2 * noise(rng, 512, 512, 1.6)
    return Texture(_grey(rng.uniform(165, 200) + mottle), (2.0, 2.0))


def plain(rng: np.random.Generator) -> Texture:
    """A smooth painted surface: stereo finds nothing on it."""
    return Texture(_grey(rng.uniform(150, 200) + 0.6 * noise(rng, 128, 128, 1.8)), (2.0, 2.0))


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
    return Texture(_grey(image), (2.4, 2.4))


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
    return Texture(_grey(mean * image + rough), (1.0, 1.1))


def fabric(rng: np.random.Generator) -> Texture:
    """Woven upholstery."""
    y, x = np.mgrid[0:512, 0:512]
    weave = 4.0 * (np.sin(x * np.pi / 4) + np.sin(y * np.pi / 4))
    slubs = 5.0 * noise(rng, 512, 512, 0.4, 6.0) + 5.0 * noise(rng, 512, 512, 0.4, 6.0).T
    return Texture(
        _grey(rng.uniform(70, 150) + weave + slubs + 6 * noise(rng, 512, 512, 1.4)), (0.6, 0.6)
    )


def leather(rng: np.random.Generator) -> Texture:
    """Wrinkled and dark."""
    wrinkles = np.abs(noise(rng, 512, 512, 0.9))
    return Texture(_grey(rng.uniform(45, 90) + 10 * wrinkles), (0.7, 0.7))


def metal(rng: np.random.Generator) -> Texture:
    """Brushed steel of kitchen machines."""
    return Texture(_grey(rng.uniform(130, 180) + 4 * noise(rng, 512, 512, 0.5, 30.0)), (0.8, 0.8))


def books(rng: np.random.Generator) -> Texture:
    """Three shelves of book spines; covers its face."""
    image = np.full((512, 512), 35.0)
    for shelf in range(3):
        floor_y = (shelf + 1) * 170 - 6
        image[floor_y : floor_y + 8] = 120.0
        x = 4
        while x < 500:
            width, height = int(rng.integers(8, 28)), int(rng.integers(95, 155))
            if rng.random() < 0.08:
                x += int(rng.integers(10, 40))
                continue
            spine = np.full((height, min(width, 508 - x)), rng.uniform(40, 220))
            spine[:, :1] *= 0.6
            for _ in range(int(rng.integers(1, 4))):
                at = int(rng.integers(4, height - 12))
                spine[at : at + int(rng.integers(3, 12)), 2:-1] = rng.uniform(30, 240)
            image[floor_y - height : floor_y, x : x + spine.shape[1]] = spine
            x += width
    return Texture(_grey(image + 3 * noise(rng, 512, 512, 0.3)), (0.0, 0.0))


def picture(rng: np.random.Generator) -> Texture:
    """A framed abstract painting; covers its face."""
    image = cv2.normalize(noise(rng, 256, 256, 1.6), np.empty(0), 40, 220, cv2.NORM_MINMAX)
    for _ in range(14):
        at, axes = rng.integers(20, 236, 2), rng.integers(8, 60, 2)
        cv2.ellipse(
            image, at.tolist(), axes.tolist(), float(rng.uniform(0, 180)), 0, 360,
            float(rng.uniform(20, 240)), -1,
        )  # fmt: skip
    cv2.rectangle(image, (0, 0), (255, 255), float(rng.uniform(20, 110)), 22)
    return Texture(_grey(image), (0.0, 0.0))


def curtain(rng: np.random.Generator) -> Texture:
    """Folds of cloth."""
    x = np.arange(512)[None, :] / 512
    folds = np.sin(2 * np.pi * (6 * x + 0.3 * noise(rng, 1, 512, 1.5)))
    return Texture(_grey(rng.uniform(110, 170) + 28 * folds + 5 * noise(rng, 512, 512, 0.4)), (1.2, 1.2))


def window(rng: np.random.Generator) -> Texture:
    """A bright window with frame and bars; covers its face."""
    image = 225.0 + 8 * noise(rng, 256, 256, 1.7)
    cv2.rectangle(image, (0, 0), (255, 255), 170.0, 24)
    cv2.line(image, (128, 0), (128, 255), 170.0, 10)
    return Texture(_grey(image), (0.0, 0.0))


def cabinet(rng: np.random.Generator) -> Texture:
    """Two doors with handles; covers its face."""
    image = _wood(rng, 256, 256, rng.uniform(110, 190)).T.copy()
    for x0 in (0, 128):
        cv2.rectangle(image, (x0 + 2, 2), (x0 + 125, 253), float(image.mean() * 0.6), 2)
        cv2.rectangle(image, (x0 + 16, 16), (x0 + 111, 239), float(image.mean() * 0.8), 2)
    for x in (116, 140):
        cv2.circle(image, (x, 128), 5, 50.0, -1)
    return Texture(_grey(image), (0.0, 0.0))


def drawers(rng: np.random.Generator) -> Texture:
    """Four drawers with handles; covers its face."""
    image = _wood(rng, 256, 256, rng.uniform(100, 180))
    for y0 in range(0, 256, 64):
        cv2.rectangle(image, (2, y0 + 2), (253, y0 + 61), float(image.mean() * 0.6), 2)
        cv2.rectangle(image, (104, y0 + 28), (152, y0 + 35), 45.0, -1)
    return Texture(_grey(image), (0.0, 0.0))


def leaves(rng: np.random.Generator) -> Texture:
    """Dense foliage."""
    image = np.full((256, 256), 40.0)
    for _ in range(260):
        at, angle = rng.integers(0, 256, 2), float(rng.uniform(0, 180))
        axes = (int(rng.integers(8, 22)), int(rng.integers(3, 8)))
        cv2.ellipse(image, at.tolist(), axes, angle, 0, 360, float(rng.uniform(40, 130)), -1)
    return Texture(_grey(image), (0.4, 0.4))


RECIPES: dict[str, Callable[[np.random.Generator], Texture]] = {
    recipe.__name__: recipe
    for recipe in (
        wood, dark_wood, planks, parquet, tiles, carpet, oriental, plaster, plain, wallpaper,
        brick, fabric, leather, metal, books, picture, curtain, window, cabinet, drawers, leaves,
    )
}  # fmt: skip


@lru_cache(maxsize=256)
def make_texture(name: str) -> Texture:
    """Texture by name, "recipe" or "recipe:seed" ("planks:3").

    Raises SceneError for an unknown recipe or a seed that is not a whole number.
    """
    recipe, _, seed = name.partition(":")
    if recipe not in RECIPES:
        raise SceneError(f"texture {name!r} is unknown; use one of {', '.join(sorted(RECIPES))}.")
    if seed and not seed.isdecimal():
        raise SceneError(f"texture {name!r} has a bad seed; write it as {recipe}:3.")
    rng = np.random.default_rng([int(seed or 0), zlib.crc32(recipe.encode())])
    return RECIPES[recipe](rng)


def marker(marker_id: int, margin_share: float) -> Texture:
    """ArUco marker of dictionary 4x4_50 with a white margin of `margin_share` of its side."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    code = cv2.aruco.generateImageMarker(dictionary, marker_id, 600)
    margin = int(round(600 * margin_share))
    image = cv2.copyMakeBorder(
        code, margin, margin, margin, margin, cv2.BORDER_CONSTANT, value=(255,)
    )
    return Texture(cv2.resize(image, (512, 512), interpolation=cv2.INTER_AREA), (0.0, 0.0))
