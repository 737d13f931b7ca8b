"""Export: the ONNX file says what PyTorch says, keeps the contract and enters the manifest."""

import json
import tomllib

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("onnx")
import onnx  # noqa: E402
from torch.nn import functional as F  # noqa: E402

from models import manifest, quantise  # noqa: E402
from models.card import card  # noqa: E402
from models.export import export, load_network, multiplications, parity_px, trained  # noqa: E402
from models.networks import build  # noqa: E402


@pytest.fixture(scope="module", params=["hybrid", "hybrid_paper", "similarity", "cost_volume"])
def exported(request, tmp_path_factory):
    torch.manual_seed(1)
    folder = tmp_path_factory.mktemp(request.param)
    network = build(request.param)
    network(torch.randn(2, 1, 48, 64), torch.randn(2, 1, 48, 64))
    torch.save(network.state_dict(), folder / "best.pt")
    lines = [
        {"step": 9, "trained_s": 60.0, "shapes": 20, "rooms": 10},
        {"step": 10, "trained_s": 66.0, "shapes_epe_px": 5.0}
        | {f"shapes_bad{n}_pct": 50.0 for n in (1, 2, 3)},
    ]
    (folder / "log.jsonl").write_text("\n".join(json.dumps(line) for line in lines))
    path = export(request.param, folder / "best.pt", trained(folder), folder / "artifacts")
    return request.param, folder, path


def test_parity_contract_and_lean_graph(exported):
    name, folder, path = exported
    network = load_network(name, folder / "best.pt")
    assert parity_px(network, path.read_bytes(), seed=5) < 0.02
    model = onnx.load(path)
    assert model.opset_import[0].version == 17
    assert {o.domain for o in model.opset_import} == {""}
    kinds = {n.op_type for n in model.graph.node}
    assert not kinds & {"BatchNormalization", "Constant", "Identity", "Loop", "If", "GridSample"}
    assert name == "cost_volume" or "Softmax" not in kinds
    properties = {p.key: p.value for p in model.metadata_props}
    assert properties["size"] == "320x240"
    assert properties["preprocessing"] == "(grey - 128) / 64"


def test_multiplications_are_those_of_the_layers(exported, monkeypatch):
    name, folder, path = exported
    network = load_network(name, folder / "best.pt")
    count = 0

    def counted(operation):
        def run(x, weight, *rest, **named):
            nonlocal count
            output = operation(x, weight, *rest, **named)
            count += output.numel() * weight[0].numel()
            return output

        return run

    for operation in ("conv2d", "conv3d"):
        monkeypatch.setattr(F, operation, counted(getattr(F, operation)))
    with torch.no_grad():
        network(torch.zeros(1, 1, 240, 320), torch.zeros(1, 1, 240, 320))
    # The towers see both eyes at once, in either count.
    assert multiplications(onnx.load(path)) == pytest.approx(count, rel=0.01)


@pytest.mark.parametrize("exported", ["hybrid"], indirect=True)
def test_another_size_of_the_same_weights(exported, tmp_path):
    name, folder, _ = exported
    path = export(name, folder / "best.pt", trained(folder), tmp_path / "artifacts", (160, 120))
    assert path.name == "hybrid-160x120.onnx"
    (entry,) = manifest.read(tmp_path / "manifest.toml")["networks"]
    assert (entry["name"], entry["width_px"], entry["height_px"]) == ("hybrid-160x120", 160, 120)
    assert entry["parity_px"] < 0.02


@pytest.mark.parametrize("exported", ["hybrid"], indirect=True)
def test_eight_bits_change_little_and_only_the_layers_named(exported):
    _, _, path = exported
    rng = np.random.default_rng(0)
    eyes = rng.normal(0, 1, (4, 2, 1, 1, 240, 320)).astype(np.float32)
    feeds = [{"left": e[0], "right": e[1]} for e in eyes]
    data = path.read_bytes()
    small = quantise.quantise(data, r"context/at16", feeds[:2])
    kinds = [n.op_type for n in onnx.load_from_string(small).graph.node]
    assert "QuantizeLinear" in kinds and len(small) < len(data)
    assert 0 < quantise.mean_shift_px(data, small, feeds[2:]) < 0.5
    assert quantise.mean_shift_px(data, data, feeds[:1]) == 0
    with pytest.raises(ValueError, match="no layer"):
        quantise.quantise(data, "nowhere", feeds)


def test_manifest_entry_and_card(exported):
    name, folder, _ = exported
    entries = tomllib.loads((folder / "manifest.toml").read_text())
    assert entries["default"] == name
    (entry,) = entries["networks"]
    assert entry["training_steps"] == 10 and entry["training_minutes"] == 1.1
    assert "20 shapes, 10 rooms" in entry["training_data"]
    assert "a53_minstr" not in entry
    row = {"family": "indoor", "mask": "all", "filled": True, "bad1_pct": 30.0, "bad2_pct": 20.0,
           "epe_px": 1.0, "ms_over_sgbm": 0.5}  # fmt: skip
    rows = [
        row | {"matcher": m, "pair": p, "bad3_pct": b}
        for m, b in ((name, 20.0), ("sgbm", 10.0))
        for p in (None, "art")
    ]
    sure = [{"matcher": m, "density_pct": 87.5, "bad2_pct": 3.25} for m in ("sgbm", name, "other")]
    text = card(name, {"rows": rows}, folder, folder, more=({"confidence": sure},))
    assert f"| {name} | 87.5 | 3.25 |" in text and "| sgbm | 87.5" in text and "| other" not in text
    assert entry["sha256"][:16] in text
    assert "88.9 % (indoor)" in text
    assert "means over 1 pairs" in text


def test_entering_again_replaces_and_keeps_the_preferred_default(tmp_path):
    path = tmp_path / "manifest.toml"
    for name, size in (("other", 1), ("hybrid_paper", 2), ("hybrid", 3), ("other", 4)):
        manifest.enter(path, {"name": name, "bytes": size})
    read = manifest.read(path)
    assert read["default"] == "hybrid"
    assert [(n["name"], n["bytes"]) for n in read["networks"]] == [
        ("hybrid", 3),
        ("hybrid_paper", 2),
        ("other", 4),
    ]
