"""The batches of a training one after another, prepared ahead where a GPU would wait for them."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import count

import numpy as np

from models.data.batches import Shards, batch

Batch = tuple[np.ndarray, np.ndarray]


def feed(
    seed: int, kinds: list[Shards], size: int, first: int = 0, every: int = 1, loaders: int = 0
) -> Iterator[Batch]:
    """Batches number first, first + every, ... without end; see `batches.batch`.

    `loaders` threads work ahead (reading, resizing and arithmetic let the others run); with none,
    each batch is made when it is asked for.
    """
    steps = count(first, every)
    if not loaders:
        for step in steps:
            yield batch(seed, step, kinds, size)
    with ThreadPoolExecutor(loaders) as pool:

        def start() -> None:
            ahead.append(pool.submit(batch, seed, next(steps), kinds, size))

        ahead: deque = deque()
        for _ in range(2 * loaders):
            start()
        while True:
            start()
            yield ahead.popleft().result()
