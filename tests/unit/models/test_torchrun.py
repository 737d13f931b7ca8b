"""Several processes train one network: the same weights everywhere, batches of their own."""

import subprocess
import sys

import numpy as np
import pytest

torch = pytest.importorskip("torch")
from models.data.shards import make_shard, write_shard  # noqa: E402

CHILD = """
import sys
from pathlib import Path
import torch
from models.data.batches import Shards
from models.place import find_place
from models.train import Order, Trainer

folder = Path(sys.argv[1])
torch.set_num_threads(1)
place = find_place()
trainer = Trainer(Order("similarity", 1.0, folder, folder, folder / "out", batch=1, place=place))
batches = trainer.batches([Shards(folder, "shapes")])
picture, truth = next(batches)
trainer.learn(picture, truth)
trainer.learn(*next(batches))
trained_s = place.longest(float(place.rank))
torch.save(
    {"weights": trainer.network.state_dict(), "picture": torch.from_numpy(picture),
     "trained_s": trained_s, "measured": trainer.check()},
    folder / f"rank{place.rank}.pt",
)
"""


def pair(rng):
    image = rng.integers(0, 256, (240, 330)).astype(np.float32)
    return [(image[:, :320], image[:, 6:326], np.full((240, 320), 6.0))]


def test_two_processes_agree_on_the_weights_and_one_of_them_keeps_them(tmp_path):
    write_shard(tmp_path / "shapes-0-0000", *make_shard(np.random.default_rng(0), pair, 4))
    child = tmp_path / "child.py"
    child.write_text(CHILD)
    launch = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node=2"]
    done = subprocess.run(
        [*launch, str(child), str(tmp_path)], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr[-2000:]
    first, second = (torch.load(tmp_path / f"rank{r}.pt", weights_only=True) for r in (0, 1))
    learnt = [k for k in first["weights"] if "running" not in k and "batches" not in k]
    assert all(torch.equal(first["weights"][k], second["weights"][k]) for k in learnt)
    assert not torch.equal(first["picture"], second["picture"])
    assert first["trained_s"] == second["trained_s"] == 1.0
    assert first["measured"] and not second["measured"]
    assert (tmp_path / "out" / "similarity" / "last.pt").exists()
