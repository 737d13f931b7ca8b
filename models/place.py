"""Where a network is trained: processor or GPU, alone or as one of several under `torchrun`."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch import distributed as group
from torch.nn.parallel import DistributedDataParallel

LOADERS_PER_GPU = 8
CPU = torch.device("cpu")


@dataclass(frozen=True)
class Place:
    """One process of a training. `rank` 0 measures, saves and reports for all."""

    device: torch.device = CPU
    rank: int = 0
    world: int = 1

    @property
    def loaders(self) -> int:
        """Threads that prepare batches ahead: none where they would take the trainer's own core."""
        return LOADERS_PER_GPU if self.device.type == "cuda" else 0

    def learner(self, network: nn.Module) -> nn.Module:
        """`network` as it is trained: averaging its gradients with the other processes'."""
        if self.world == 1:
            return network
        return DistributedDataParallel(network)

    def clock_s(self) -> float:
        """Work done: the thread's own time on a processor that others use too, else the wall's."""
        return time.monotonic() if self.device.type == "cuda" else time.thread_time()

    def longest(self, seconds: float) -> float:
        """The largest value of all processes, so that they agree on rates and on the end."""
        if self.world == 1:
            return seconds
        value = torch.tensor(seconds, dtype=torch.float64, device=self.device)
        group.all_reduce(value, group.ReduceOp.MAX)
        return float(value)

    def put(self, x: Tensor) -> Tensor:
        return x.to(self.device, non_blocking=True)


def find_place() -> Place:
    """The GPU of this process if there is one, joined with the others that `torchrun` started."""
    gpus = torch.cuda.device_count()
    device = torch.device("cuda", int(os.environ.get("LOCAL_RANK", 0)) % gpus) if gpus else None
    if device is not None:
        torch.cuda.set_device(device)
    if "WORLD_SIZE" not in os.environ:
        return Place(device or CPU)
    group.init_process_group("nccl" if device is not None else "gloo")
    return Place(device or CPU, group.get_rank(), group.get_world_size())
