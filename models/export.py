"""Weights to ONNX: `python -m models.export hybrid --weights training/hybrid/best.pt`.

Writes `artifacts/<name>.onnx` and its entry in `manifest.toml`. The graph has batch
normalisation folded in and constants computed, in standard operators only (opset 17); it runs on
any machine. It is written only if ONNX Runtime gives what PyTorch gives. The same weights serve
other sizes: `--size 640x480` writes `artifacts/<name>-640x480.onnx`, an entry of that name.
`--int8 context` then puts the layers whose output names match into 8 bits (see `quantise.py`).
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import tempfile
import warnings
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import torch
from torch import nn

from models import manifest
from models.networks import NETWORKS, Exported, build, fold_norms
from models.networks.blocks import INPUT_MEAN, INPUT_SCALE, MAX_DISPARITY
from models.quantise import mean_shift_px, quantise, rendered_feeds
from models.train import Order

DEFAULT_SIZE, OPSET = (320, 240), 17  # width, height in px
TOLERANCE_PX, LARGEST_BYTES = 0.02, 2_000_000
CALIBRATION_PAIRS = 48  # half of them to calibrate, half to see what changed
Size = tuple[int, int]
ARTIFACTS = Path(__file__).resolve().parent / "artifacts"


def load_network(name: str, weights: Path) -> nn.Module:
    """A network with its weights, folded, in eval mode."""
    network = build(name)
    state = torch.load(weights, weights_only=True)
    network.load_state_dict(state.get("network", state))
    return fold_norms(network.eval())


def _trace(network: nn.Module, path: Path, size: Size) -> None:
    blank = torch.zeros(1, 1, size[1], size[0])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about the older exporter, which makes the leaner graph
        torch.onnx.export(
            Exported(network).eval(),
            (blank, blank),
            str(path),
            opset_version=OPSET,
            input_names=["left", "right"],
            output_names=["disparity", "confidence"],
            dynamo=False,
        )


def _simplify(source: Path, target: Path) -> None:
    """Fold constants and remove what does nothing, with standard operators only."""
    options = onnxruntime.SessionOptions()
    options.graph_optimization_level = onnxruntime.GraphOptimizationLevel.ORT_ENABLE_BASIC
    options.optimized_model_filepath = str(target)
    options.log_severity_level = 3
    onnxruntime.InferenceSession(str(source), options, providers=["CPUExecutionProvider"])


def multiplications(model: onnx.ModelProto) -> int:
    """Multiply-accumulates of all convolutions for one pair."""
    inferred = onnx.shape_inference.infer_shapes(model)
    values = [*inferred.graph.value_info, *inferred.graph.output]
    sizes = {v.name: math.prod(d.dim_value for d in v.type.tensor_type.shape.dim) for v in values}
    weights = {i.name: list(i.dims) for i in inferred.graph.initializer}
    total = 0
    for node in inferred.graph.node:
        if node.op_type == "Conv":
            total += sizes[node.output[0]] * math.prod(weights[node.input[1]][1:])
    return total


def parity_px(network: nn.Module, data: bytes, seed: int = 0, size: Size = DEFAULT_SIZE) -> float:
    """Largest difference in disparity between PyTorch and ONNX Runtime on a random pair."""
    rng = np.random.default_rng(seed)
    width, height = size
    coarse = rng.uniform(0, 255, (2, height // 8, width // 8)).astype(np.float32)
    grey = np.kron(coarse, np.ones((8, 8), np.float32)) + rng.normal(0, 4, (2, height, width))
    eyes = ((grey - INPUT_MEAN) / INPUT_SCALE).astype(np.float32)[:, None, None]
    session = onnxruntime.InferenceSession(data, providers=["CPUExecutionProvider"])
    found = session.run(["disparity"], {"left": eyes[0], "right": eyes[1]})[0]
    with torch.no_grad():
        expected = network(torch.from_numpy(eyes[0]), torch.from_numpy(eyes[1])).disparity.numpy()
    both = np.isfinite(found) & np.isfinite(expected)  # a left-right check leaves gaps
    if both.mean() < np.isfinite(expected).mean() - 0.01:
        return math.inf
    return float(np.abs(found - expected)[both].max(initial=0.0))


def onnx_bytes(name: str, network: nn.Module, size: Size = DEFAULT_SIZE) -> bytes:
    """The exported model with its contract in the metadata."""
    with tempfile.TemporaryDirectory() as folder:
        raw, simple = Path(folder) / "raw.onnx", Path(folder) / "simple.onnx"
        _trace(network, raw, size)
        _simplify(raw, simple)
        model = onnx.load(simple)
    del model.opset_import[:]
    model.opset_import.append(onnx.helper.make_opsetid("", OPSET))
    model.producer_name, model.producer_version, model.doc_string = "sweeper", "", ""
    contract = {
        "name": name,
        "size": f"{size[0]}x{size[1]}",
        "max_disparity_px": str(MAX_DISPARITY),
        "preprocessing": f"(grey - {INPUT_MEAN:g}) / {INPUT_SCALE:g}",
    }
    onnx.helper.set_model_props(model, contract)
    onnx.checker.check_model(model)
    return model.SerializeToString()


def export(
    name: str, weights: Path, training: dict[str, object], out: Path = ARTIFACTS,
    size: Size = DEFAULT_SIZE, int8: str = "", pairs: Path = Path("training/pairs"),
) -> Path:  # fmt: skip
    """Export one network and enter it in the manifest beside `out`. Returns the ONNX file.

    `int8` is a pattern of layers for 8 bits ("" for none), calibrated on rendered `pairs`.

    Raises ValueError if PyTorch and ONNX Runtime differ or the file is too large.
    """
    network = load_network(name, weights)
    data = onnx_bytes(name, network, size)
    off = parity_px(network, data, size=size)
    mmac = multiplications(onnx.load_from_string(data)) / 1e6
    if size != DEFAULT_SIZE:
        name = f"{name}-{size[0]}x{size[1]}"
    if int8:
        feeds = rendered_feeds(pairs, CALIBRATION_PAIRS)
        plain, data = data, quantise(data, int8, feeds[: CALIBRATION_PAIRS // 2])
        shift = mean_shift_px(plain, data, feeds[CALIBRATION_PAIRS // 2 :])
        training = {**training, "int8": int8, "int8_mean_shift_px": round(shift, 4)}
    if off > TOLERANCE_PX:
        raise ValueError(f"{name}: ONNX Runtime differs from PyTorch by {off:.3f} px")
    if len(data) > LARGEST_BYTES:
        raise ValueError(f"{name}: {len(data)} bytes are more than {LARGEST_BYTES}")
    out.mkdir(parents=True, exist_ok=True)
    path = out / f"{name}.onnx"
    path.write_bytes(data)
    manifest.enter(
        out.parent / "manifest.toml",
        {
            "name": name,
            "file": f"{out.name}/{name}.onnx",
            "sha256": hashlib.sha256(data).hexdigest(),
            "bytes": len(data),
            "width_px": size[0],
            "height_px": size[1],
            "max_disparity_px": MAX_DISPARITY,
            "preprocessing": f"(grey - {INPUT_MEAN:g}) / {INPUT_SCALE:g}",
            "inputs": ["left", "right"],
            "outputs": ["disparity", "confidence"],
            "opset": OPSET,
            "parameters": sum(p.numel() for p in network.parameters()),
            "mmac": round(mmac, 1),
            "parity_px": round(off, 6),
            "licence": "MIT",
            **training,
        },
    )
    return path


def trained(folder: Path) -> dict[str, object]:
    """What `log.jsonl` says about the training: steps, minutes and pairs of each kind."""
    lines = [json.loads(line) for line in (folder / "log.jsonl").read_text().splitlines()]
    pairs = [f"{line['shapes']} shapes, {line['rooms']} rooms" for line in lines if "rooms" in line]
    start = next(({"training_start": n["start"]} for n in lines if "start" in n), {})
    return {
        "training_data": f"rendered pairs only: {pairs[-1] if pairs else 'a few'}",
        "training_batch": next((n["batch"] for n in lines if "batch" in n), Order.batch),
        "training_rate": next((n["top_rate"] for n in lines if "top_rate" in n), Order.rate),
        "training_steps": lines[-1]["step"],
        "training_minutes": round(lines[-1]["trained_s"] / 60, 1),
        **start,
    }


def _size(text: str) -> Size:
    """ "640x480" to (640, 480); both must be multiples of 8."""
    width, height = (int(n) for n in text.split("x"))
    if width % 8 or height % 8:
        raise argparse.ArgumentTypeError(f"{text}: width and height must be multiples of 8")
    return width, height


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("name", choices=sorted(NETWORKS))
    parser.add_argument("--weights", type=Path, help="default: training/<name>/best.pt")
    parser.add_argument("--size", type=_size, default=DEFAULT_SIZE, help="WIDTHxHEIGHT")
    parser.add_argument("--int8", default="", metavar="PATTERN", help="layers for 8 bits")
    given = parser.parse_args()
    folder = Path("training") / given.name
    weights = given.weights or folder / "best.pt"
    path = export(given.name, weights, trained(weights.parent), ARTIFACTS, given.size, given.int8)
    print(f"{path}: {path.stat().st_size} bytes")


if __name__ == "__main__":
    main()
