"""Some layers of an exported network in 8 bits, by calibration, without training.

Weights become int8 per output channel, activations uint8 between the extremes seen on rendered
pairs (Jacob et al., CVPR 2018), as QuantizeLinear/DequantizeLinear pairs that ONNX Runtime fuses.
On a Cortex-A53 the inverted residuals of the context gain; towers, volume and heads do not, as
going to 8 bits and back costs them what it saves, and the disparity itself stays in float.
"""

from __future__ import annotations

import logging
import re
import tempfile
from pathlib import Path

import numpy as np
import onnx
import onnxruntime

from models.data.batches import Shards
from models.networks.blocks import INPUT_MEAN, INPUT_SCALE

KINDS = ("Conv", "Add", "Relu")
Feed = dict[str, np.ndarray]


def rendered_feeds(folder: Path, count: int, seed: int = 5) -> list[Feed]:
    """Inputs of a network from `count` rendered pairs, shapes and rooms in turn."""
    rng = np.random.default_rng(seed)
    present = [s for s in (Shards(folder, kind) for kind in ("shapes", "rooms")) if s.images]
    if not present:
        raise SystemExit(f"no shards in {folder}: run python -m models.data.shards")
    feeds = []
    for i in range(count):
        images, _ = present[i % len(present)].pick(rng)
        eyes = ((images.astype(np.float32) - INPUT_MEAN) / INPUT_SCALE)[:, None, None]
        feeds.append({"left": eyes[0], "right": eyes[1]})
    return feeds


def _named(model: onnx.ModelProto, pattern: str) -> list[str]:
    """Give every node a name; returns those of layers whose output matches the pattern."""
    for index, node in enumerate(model.graph.node):
        node.name = node.name or f"node{index}"
    return [
        n.name for n in model.graph.node if n.op_type in KINDS and re.search(pattern, n.output[0])
    ]


def quantise(data: bytes, pattern: str, feeds: list[Feed]) -> bytes:
    """The model with the layers whose output name matches `pattern` in 8 bits.

    Raises ValueError if there is no such layer.
    """
    from onnxruntime.quantization import (
        CalibrationDataReader,
        QuantFormat,
        QuantType,
        quantize_static,
    )

    class Reader(CalibrationDataReader):  # type: ignore[misc]
        def __init__(self) -> None:
            self.rest = iter(feeds)

        def get_next(self) -> Feed | None:
            return next(self.rest, None)

    model = onnx.shape_inference.infer_shapes(onnx.load_from_string(data))
    chosen = _named(model, pattern)
    if not chosen:
        raise ValueError(f"no layer matches {pattern!r}")
    before = logging.root.manager.disable
    logging.disable(logging.WARNING)  # it advises a step that was taken already
    try:
        with tempfile.TemporaryDirectory() as folder:
            source, target = Path(folder) / "float.onnx", Path(folder) / "int8.onnx"
            onnx.save(model, source)
            quantize_static(
                source, target, Reader(), quant_format=QuantFormat.QDQ, per_channel=True,
                activation_type=QuantType.QUInt8, weight_type=QuantType.QInt8,
                nodes_to_quantize=chosen, op_types_to_quantize=list(KINDS),
            )  # fmt: skip
            made = onnx.load(target)
    finally:
        logging.disable(before)
    del made.opset_import[:]
    made.opset_import.extend(model.opset_import)
    made.graph.ClearField("value_info")
    onnx.checker.check_model(made)
    return made.SerializeToString()


def mean_shift_px(first: bytes, second: bytes, feeds: list[Feed]) -> float:
    """Mean absolute difference of the disparities of two models."""
    sessions = [
        onnxruntime.InferenceSession(d, providers=["CPUExecutionProvider"]) for d in (first, second)
    ]
    off = []
    for feed in feeds:
        one, other = (s.run(["disparity"], feed)[0] for s in sessions)
        off.append(float(np.abs(one - other).mean()))
    return float(np.mean(off))
