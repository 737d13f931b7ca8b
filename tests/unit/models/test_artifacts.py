"""The networks that ship: present, undamaged, small, documented, and better than guessing."""

import hashlib
import tomllib
from pathlib import Path

import numpy as np
import pytest

from models.data import textures
from models.data.photometry import photograph
from models.data.shapes import shapes_pair
from robot.evaluate.stereo import fill_background

MODELS = Path(__file__).resolve().parents[3] / "models"
MANIFEST = tomllib.loads((MODELS / "manifest.toml").read_text())
NAMES = [n["name"] for n in MANIFEST["networks"]]


@pytest.fixture(scope="module")
def pairs():
    bank = textures.bank(77, 24)
    found = []
    for seed in range(4):
        rng = np.random.default_rng((4711, seed))
        left, right, disparity = shapes_pair(rng, bank)
        found.append((*photograph(rng, left, right), disparity))
    return found


@pytest.fixture(params=NAMES)
def entry(request):
    return next(n for n in MANIFEST["networks"] if n["name"] == request.param)


def session(entry):
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    path = str(MODELS / entry["file"])
    return onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])


def test_the_default_is_one_of_them_and_the_paper_network_is_there():
    assert MANIFEST["default"] in NAMES
    assert "hybrid_paper" in NAMES
    assert len(set(NAMES)) == len(NAMES)


def test_every_artifact_is_in_the_manifest():
    listed = {MODELS / n["file"] for n in MANIFEST["networks"]}
    assert set((MODELS / "artifacts").glob("*.onnx")) == listed


def test_file_hash_size_and_card(entry):
    data = (MODELS / entry["file"]).read_bytes()
    assert hashlib.sha256(data).hexdigest() == entry["sha256"]
    assert len(data) == entry["bytes"] <= 2_000_000
    card = (MODELS / entry["file"]).with_suffix(".md").read_text()
    assert entry["sha256"][:16] in card, "the card belongs to other weights"


def test_contract(entry):
    network = session(entry)
    shape = [1, 1, entry["height_px"], entry["width_px"]]
    assert {i.name: i.shape for i in network.get_inputs()} == {"left": shape, "right": shape}
    assert {o.name: o.shape for o in network.get_outputs()} == {
        "disparity": shape,
        "confidence": shape,
    }


def test_it_beats_a_constant_guess_clearly(entry, pairs):
    network = session(entry)
    ours, guess = [], []
    for left, right, disparity in pairs:
        eyes = [((i.astype(np.float32) - 128) / 64)[None, None] for i in (left, right)]
        found, confidence = network.run(
            ["disparity", "confidence"], {"left": eyes[0], "right": eyes[1]}
        )
        assert found.dtype == np.float32
        found = fill_background(found[0, 0])  # `similarity` leaves gaps
        assert found.min() >= 0 and found.max() < 80
        assert confidence.min() >= 0 and confidence.max() <= 1
        ours.append(np.abs(found - disparity).mean())
        guess.append(np.abs(np.median(disparity) - disparity).mean())
    assert np.mean(ours) < 0.5 * np.mean(guess)


def test_confidence_tells_good_pixels_from_bad_ones(entry, pairs):
    network = session(entry)
    right_ones, wrong_ones = [], []
    for left, right, disparity in pairs:
        eyes = [((i.astype(np.float32) - 128) / 64)[None, None] for i in (left, right)]
        found, confidence = network.run(None, {"left": eyes[0], "right": eyes[1]})
        good = np.abs(found[0, 0] - disparity) < 2
        right_ones.append(confidence[0, 0][good])
        wrong_ones.append(confidence[0, 0][~good])
    assert np.concatenate(right_ones).mean() > np.concatenate(wrong_ones).mean() + 0.1
