"""The stereo matchers of the bench by name: networks of the manifest, SGBM and BM."""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from robot.config import CameraConfig, PerceptionConfig
from robot.errors import ModelError
from robot.geometry.stereo import StereoCamera
from robot.perception.depth import make_depth

MAX_DISPARITY = 64
MODELS = Path(__file__).resolve().parents[3] / "models"
CLASSICAL = ("sgbm", "sgbm_example", "bm")
Match = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True, slots=True, eq=False)
class Matcher:
    """`match(left, right)`: grey uint8 (240, 320) to disparity float32 px, NaN where empty.

    `trust(left, right)` gives the confidence, 0 to 1; without one of its own a matcher is sure of
    whatever it gives.
    """

    name: str
    match: Match
    a53_minstr: float | None = None
    own_trust: Match | None = None

    def trust(self, left: np.ndarray, right: np.ndarray) -> np.ndarray:
        """Confidence float32 (240, 320), 0 where empty."""
        if self.own_trust is not None:
            return self.own_trust(left, right)
        return np.isfinite(self.match(left, right)).astype(np.float32)


def _empty_as_nan(fixed: np.ndarray) -> np.ndarray:
    """OpenCV's fixed point (1/16 px) to px, NaN where nothing was matched.

    That is negative, or zero: the 3-way mode leaves zeros along the right border, and a true zero
    would be a point at infinity.
    """
    return np.where(fixed <= 0, np.float32(np.nan), fixed.astype(np.float32) / 16)


def _padded(compute: Match, columns: int) -> Match:
    """Give the left border something to search in: replicated columns, cut off again."""

    def match(left: np.ndarray, right: np.ndarray) -> np.ndarray:
        wide = [
            cv2.copyMakeBorder(i, 0, 0, columns, 0, cv2.BORDER_REPLICATE) for i in (left, right)
        ]
        return _empty_as_nan(compute(wide[0], wide[1])[:, columns:])

    return match


def example_sgbm(max_px: int) -> Match:
    """The settings of OpenCV's own example, without padding."""
    engine = cv2.StereoSGBM.create(
        0, max_px, 5, 8 * 25, 32 * 25, disp12MaxDiff=1, uniquenessRatio=10,
        speckleWindowSize=100, speckleRange=32,
    )  # fmt: skip
    return lambda left, right: _empty_as_nan(engine.compute(left, right))


def block_matching(max_px: int) -> Match:
    """OpenCV's StereoBM with a window of 15, on the padded pair."""
    return _padded(cv2.StereoBM.create(max_px, 15).compute, max_px)


def classical_match(name: str, camera: StereoCamera, max_px: int) -> Match:
    """One of CLASSICAL for images of the camera's size; `max_px` is a multiple of 16."""
    if name == "sgbm":
        depth = make_depth(PerceptionConfig(matcher="sgbm", max_disparity_px=max_px), camera)
        return lambda left, right: depth.match(left, right).disparity_px
    return example_sgbm(max_px) if name == "sgbm_example" else block_matching(max_px)


def read_manifest(models: Path) -> dict[str, Any]:
    """`manifest.toml` of a models folder; ModelError if missing or malformed."""
    path = models / "manifest.toml"
    try:
        manifest = tomllib.loads(path.read_text())
        names = {n["name"] for n in manifest["networks"]}
    except (OSError, tomllib.TOMLDecodeError, KeyError, TypeError):
        raise ModelError(f"{path} is missing or malformed; restore it from the release.") from None
    if manifest.get("default") not in names:
        raise ModelError(f"{path} names no default among its networks; restore it.")
    return manifest


def network(name: str, models: Path = MODELS, threads: int = 1) -> Matcher:
    """A network of the manifest, as the runtime runs it. ModelError if missing or damaged."""
    entries = {n["name"]: n for n in read_manifest(models)["networks"]}
    if name not in entries:
        known = ", ".join([*sorted(entries), *CLASSICAL])
        raise ModelError(f"matcher {name!r} is not in {models / 'manifest.toml'}; use {known}.")
    path = models / entries[name]["file"]
    if not path.is_file():
        raise ModelError(f"{path} is missing; restore it from the release.")
    data = path.read_bytes()
    if hashlib.sha256(data).hexdigest() != entries[name]["sha256"]:
        raise ModelError(f"{path} does not match its sha256 in manifest.toml; restore both.")
    config = PerceptionConfig(matcher="onnx", onnx_threads=threads)
    depth = make_depth(config, CameraConfig().stereo_camera(), data)
    return Matcher(
        name,
        lambda left, right: depth.match(left, right).disparity_px,
        entries[name].get("a53_minstr"),
        lambda left, right: depth.match(left, right).confidence,
    )


def make_matcher(name: str, models: Path = MODELS, threads: int = 1) -> Matcher:
    """Any matcher of the bench by name."""
    if name not in CLASSICAL:
        return network(name, models, threads)
    a53 = read_manifest(models).get("a53_minstr", {}).get(name)
    match = classical_match(name, CameraConfig().stereo_camera(), MAX_DISPARITY)
    return Matcher(name, match, a53)
