"""Which matcher a configuration asks for."""

from __future__ import annotations

from robot.config import PerceptionConfig
from robot.errors import ModelError
from robot.geometry.stereo import StereoCamera
from robot.perception.depth.base import Depth
from robot.perception.depth.given import GivenDepth
from robot.perception.depth.onnx import OnnxDepth
from robot.perception.depth.sgbm import SgbmDepth


def make_depth(
    config: PerceptionConfig,
    camera: StereoCamera,
    model: bytes | None = None,
    *,
    rows: int | None = None,
) -> Depth:
    """The matcher `config.matcher` for one camera.

    `model` holds the bytes of the ONNX file, for "onnx" only. Raises ModelError when they are
    missing, damaged or made for another image size. Below the first `rows` no disparity is needed:
    matchers that can save the work leave it unknown there.
    """
    if config.matcher == "given":
        return GivenDepth(camera)
    if config.matcher == "sgbm":
        return SgbmDepth(camera, config.max_disparity_px, rows)
    if model is None:
        raise ModelError(
            "perception.matcher is 'onnx' but no network was given; name one in perception.model."
        )
    return OnnxDepth(camera, model, config.max_disparity_px, config.onnx_threads)
