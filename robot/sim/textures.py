"""Grey textures by name: surfaces that repeat, and pictures of things that cover a whole face."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from functools import lru_cache

import cv2
import numpy as np

from robot.errors import SceneError
from robot.sim.surfaces import (
    Texture,
    black,
    brick,
    carpet,
    dark_wood,
    fabric,
    grain,
    grey,
    leather,
    metal,
    noise,
    parquet,
    plain,
    planks,
    plaster,
    tiles,
    wallpaper,
    wood,
)


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
    return Texture(grey(60 + 120 * image + 8 * noise(rng, 512, 512, 0.3)), (0.0, 0.0))


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
    return Texture(grey(image + 3 * noise(rng, 512, 512, 0.3)), (0.0, 0.0))


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
    return Texture(grey(image), (0.0, 0.0))


def curtain(rng: np.random.Generator) -> Texture:
    """Folds of cloth."""
    x = np.arange(512)[None, :] / 512
    folds = np.sin(2 * np.pi * (6 * x + 0.3 * noise(rng, 1, 512, 1.5)))
    return Texture(
        grey(rng.uniform(110, 170) + 28 * folds + 5 * noise(rng, 512, 512, 0.4)), (1.2, 1.2)
    )


def window(rng: np.random.Generator) -> Texture:
    """A bright window with frame and bars; covers its face."""
    image = 225.0 + 8 * noise(rng, 256, 256, 1.7)
    cv2.rectangle(image, (0, 0), (255, 255), 170.0, 24)
    cv2.line(image, (128, 0), (128, 255), 170.0, 10)
    return Texture(grey(image), (0.0, 0.0))


def cabinet(rng: np.random.Generator) -> Texture:
    """Two doors with handles; covers its face."""
    image = grain(rng, 256, 256, rng.uniform(110, 190)).T.copy()
    for x0 in (0, 128):
        cv2.rectangle(image, (x0 + 2, 2), (x0 + 125, 253), float(image.mean() * 0.6), 2)
        cv2.rectangle(image, (x0 + 16, 16), (x0 + 111, 239), float(image.mean() * 0.8), 2)
    for x in (116, 140):
        cv2.circle(image, (x, 128), 5, 50.0, -1)
    return Texture(grey(image), (0.0, 0.0))


def drawers(rng: np.random.Generator) -> Texture:
    """Four drawers with handles; covers its face."""
    image = grain(rng, 256, 256, rng.uniform(100, 180))
    for y0 in range(0, 256, 64):
        cv2.rectangle(image, (2, y0 + 2), (253, y0 + 61), float(image.mean() * 0.6), 2)
        cv2.rectangle(image, (104, y0 + 28), (152, y0 + 35), 45.0, -1)
    return Texture(grey(image), (0.0, 0.0))


def leaves(rng: np.random.Generator) -> Texture:
    """Dense foliage."""
    image = np.full((256, 256), 40.0)
    for _ in range(260):
        at, angle = rng.integers(0, 256, 2), float(rng.uniform(0, 180))
        axes = (int(rng.integers(8, 22)), int(rng.integers(3, 8)))
        cv2.ellipse(image, at.tolist(), axes, angle, 0, 360, float(rng.uniform(40, 130)), -1)
    return Texture(grey(image), (0.4, 0.4))


RECIPES: dict[str, Callable[[np.random.Generator], Texture]] = {
    recipe.__name__: recipe
    for recipe in (
        wood, dark_wood, black, planks, parquet, tiles, carpet, oriental, plaster, plain, wallpaper,
        brick, fabric, leather, metal, books, picture, curtain, window, cabinet, drawers, leaves,
    )
}  # fmt: skip


def check_texture(name: str) -> None:
    """Raise SceneError unless `name` is "recipe" or "recipe:seed" ("planks:3")."""
    recipe, _, seed = name.partition(":")
    if recipe not in RECIPES:
        raise SceneError(f"texture {name!r} is unknown; use one of {', '.join(sorted(RECIPES))}.")
    if ":" in name and not (seed.isascii() and seed.isdecimal()):
        raise SceneError(f"texture {name!r} has a bad seed; write it as {recipe}:3.")


@lru_cache(maxsize=256)
def make_texture(name: str) -> Texture:
    """Texture by name, "recipe" or "recipe:seed". Raises SceneError for an unknown one."""
    check_texture(name)
    recipe, _, seed = name.partition(":")
    rng = np.random.default_rng([int(seed or 0), zlib.crc32(recipe.encode())])
    return RECIPES[recipe](rng)


def marker(marker_id: int, margin_share: float) -> Texture:
    """ArUco marker of dictionary 4x4_50 with a white margin of `margin_share` of its side."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    code = cv2.aruco.generateImageMarker(dictionary, marker_id, 600)
    margin = round(600 * margin_share)
    image = cv2.copyMakeBorder(
        code, margin, margin, margin, margin, cv2.BORDER_CONSTANT, value=(255,)
    )
    return Texture(cv2.resize(image, (512, 512), interpolation=cv2.INTER_AREA), (0.0, 0.0))
