"""Train one network: `python -m models.train hybrid --minutes 60` (resumes if interrupted).

The pairs come from `models.data.shards`, which may still be writing: new shards are picked up
every minute. The learning rate follows a cosine over the minutes trained. On a processor they are
its own minutes, not the clock's, so that a busy machine does not shorten the training. A GPU is
used where there is one, and several with `torchrun --nproc-per-node N -m models.train ...`, each
on batches of its own.

Everything goes to `training/<name>/`: `last.pt` (to resume), `best.pt` (weights that were best on
validation), `log.jsonl` and `curve.png`. Measured and kept are the weights averaged over the last
steps: an hour before the end they are nearly as good as at the end.

Fine-tuning is a training of other kinds of shards that starts from weights:
`python -m models.train hybrid --kinds real --start training/hybrid/best.pt --out training/tuned`.
A wide network may start from the weights of a narrow one.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import torch
from torch import nn
from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn

from models import validation
from models.curves import draw_training
from models.data.batches import Shards
from models.data.feed import Batch, feed
from models.loss import stereo_loss
from models.networks import NETWORKS, build
from models.networks.blocks import INPUT_MEAN, INPUT_SCALE
from models.place import Place, find_place
from models.widen import widened

LOSS_SCALE = 1024.0  # keeps small gradients of bfloat16 out of the denormal range
WARMUP_STEPS = 100
AVERAGE = 0.998  # share that the averaged weights keep at each step
REPORT_S, CHECK_S = 30.0, 180.0


@dataclass(frozen=True)
class Order:
    """What to train and for how long."""

    name: str
    minutes: float
    pairs: Path
    held_back: Path
    out: Path
    batch: int = 16
    rate: float = 3e-3
    seed: int = 0
    bf16: bool = True
    kinds: tuple[str, ...] = ("shapes", "rooms")
    start: Path | None = None
    place: Place = field(default_factory=Place)


class Trainer:
    """One network, its optimiser and the time it has trained."""

    def __init__(self, order: Order) -> None:
        torch.manual_seed(order.seed)
        self.order = order
        self.place = order.place
        self.network: nn.Module = build(order.name).to(self.place.device)
        if order.start is not None:
            state = torch.load(order.start, self.place.device, weights_only=True)
            self.network.load_state_dict(widened(state.get("network", state), self.network))
        self.optimiser = torch.optim.AdamW(self.network.parameters(), order.rate, weight_decay=1e-4)
        self.average = AveragedModel(
            self.network, multi_avg_fn=get_ema_multi_avg_fn(AVERAGE), use_buffers=True
        )
        self.step, self.trained_s, self.best = 0, 0.0, math.inf
        self.folder = order.out / order.name
        self.folder.mkdir(parents=True, exist_ok=True)
        if (self.folder / "last.pt").exists():
            self.load()
        self.learner = self.place.learner(self.network)

    def load(self) -> None:
        """Go on from `last.pt`."""
        state = torch.load(self.folder / "last.pt", self.place.device, weights_only=True)
        self.network.load_state_dict(state["network"])
        self.average.load_state_dict(state["average"])
        self.optimiser.load_state_dict(state["optimiser"])
        self.step, self.trained_s, self.best = state["step"], state["trained_s"], state["best"]

    def save(self) -> None:
        """Write `last.pt`, never half of it."""
        partial = self.folder / "last.pt.partial"
        state = {
            "network": self.network.state_dict(),
            "average": self.average.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "step": self.step,
            "trained_s": self.trained_s,
            "best": self.best,
        }
        torch.save(state, partial)
        partial.replace(self.folder / "last.pt")

    def rate(self) -> float:
        """Learning rate now: a short warm-up, then half a cosine over the ordered minutes."""
        progress = min(1.0, self.trained_s / (60 * self.order.minutes))
        warm = min(1.0, (self.step + 1) / WARMUP_STEPS)
        return self.order.rate * warm * 0.5 * (1 + math.cos(math.pi * progress)) + 1e-5

    def batches(self, kinds: list[Shards]) -> Iterator[Batch]:
        """The batches of this process from the present step on."""
        world, o = self.place.world, self.order
        first = self.step * world + self.place.rank
        return feed(o.seed, kinds, o.batch, first, world, self.place.loaders)

    def learn(self, grey: np.ndarray, truth: np.ndarray) -> float:
        """One step of the optimiser on a batch; returns the loss."""
        x = (self.place.put(torch.from_numpy(grey)) - INPUT_MEAN) / INPUT_SCALE
        for group in self.optimiser.param_groups:
            group["lr"] = self.rate()
        with torch.autocast(self.place.device.type, torch.bfloat16, enabled=self.order.bf16):
            estimate = self.learner(x[:, :1], x[:, 1:])
        loss = stereo_loss(estimate, self.place.put(torch.from_numpy(truth)))
        self.optimiser.zero_grad(set_to_none=True)
        (loss * LOSS_SCALE).backward()
        for parameter in self.network.parameters():
            if parameter.grad is not None:
                parameter.grad.div_(LOSS_SCALE)
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), 5.0)
        self.optimiser.step()
        self.average.update_parameters(self.network)
        self.step += 1
        return float(loss.detach())

    def check(self) -> dict[str, float]:
        """Measure on the held-back pairs, keep the weights if they are the best so far."""
        if self.place.rank:
            return {}
        measured = validation.measure(self.average.module, self.order.held_back, self.order.kinds)
        score = sum(v for k, v in measured.items() if k.endswith("epe_px"))
        if measured and score < self.best:
            self.best = score
            torch.save(self.average.module.state_dict(), self.folder / "best.pt")
        self.save()
        return measured

    def note(self, **values: float | int | str) -> None:
        """One line to `log.jsonl` and to the terminal."""
        if self.place.rank:
            return
        line = json.dumps(
            {k: round(v, 4) if isinstance(v, float) else v for k, v in values.items()}
        )
        with (self.folder / "log.jsonl").open("a") as file:
            file.write(line + "\n")
        print(line, flush=True)

    def run(self) -> None:
        """Train until the ordered minutes are over."""
        kinds = [Shards(self.order.pairs, kind) for kind in self.order.kinds]
        if not any(k.images for k in kinds):
            raise SystemExit(f"no shards in {self.order.pairs}: run python -m models.data.shards")
        o = self.order
        began = {} if o.start is None else {"start": str(o.start)}
        self.note(
            step=self.step, trained_s=self.trained_s, batch=o.batch * self.place.world,
            top_rate=o.rate, device=self.place.device.type, **began,
        )  # fmt: skip
        batches = self.batches(kinds)
        last_report = last_check = self.trained_s
        total, count = 0.0, 0
        while self.trained_s < 60 * self.order.minutes:
            began_s = self.place.clock_s()
            total, count = total + self.learn(*next(batches)), count + 1
            self.trained_s += self.place.longest(self.place.clock_s() - began_s)
            if self.trained_s - last_report > REPORT_S:
                pairs = [k.rescan() for k in kinds]
                self.note(
                    step=self.step, trained_s=self.trained_s, loss=total / count, rate=self.rate(),
                    **dict(zip(o.kinds, pairs, strict=True)),
                )  # fmt: skip
                last_report, total, count = self.trained_s, 0.0, 0
            if self.trained_s - last_check > CHECK_S:
                self.note(step=self.step, trained_s=self.trained_s, **self.check())
                last_check = self.trained_s
        self.note(step=self.step, trained_s=self.trained_s, **self.check())
        if self.place.rank == 0:
            draw_training(self.folder)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("name", choices=sorted(NETWORKS))
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--pairs", type=Path, default=Path("training/pairs"))
    parser.add_argument("--held-back", type=Path, default=Path("training/val"))
    parser.add_argument("--out", type=Path, default=Path("training"))
    parser.add_argument("--batch", type=int, default=16)
    parser.add_argument("--rate", type=float, default=3e-3)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--kinds", default="shapes,rooms", help="of shards, comma-separated")
    parser.add_argument("--start", type=Path, help="weights to start a new training from")
    parser.add_argument("--fp32", action="store_true", help="no bfloat16 autocast")
    given = parser.parse_args()
    torch.set_num_threads(given.threads)
    torch.set_flush_denormal(True)
    order = Order(
        given.name, given.minutes, given.pairs, given.held_back, given.out, given.batch,
        given.rate, given.seed, not given.fp32, tuple(given.kinds.split(",")), given.start,
        find_place(),
    )  # fmt: skip
    Trainer(order).run()


if __name__ == "__main__":
    main()
