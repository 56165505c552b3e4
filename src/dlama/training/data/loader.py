"""A source and a position in -> the batches of a run from there on, the same ones however often it was stopped.

Sample number n of a run is a function of the seed and n alone: its index comes from a shuffling of the source that is new
in every epoch, its random numbers from a generator seeded with (seed, n). The position is how many were used.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Iterator
from typing import Any

import numpy as np
import torch
from torch.utils.data import DataLoader, Dataset, Sampler, default_collate

from dlama.geometry.kernels.jit import use_threads
from dlama.training.data.batches import Batch, check_sample
from dlama.training.data.sources import SampleSource
from dlama.training.settings import TrainSettings

LARGEST_SHUFFLE = 1 << 22
"""Sources with more indices (or runs of them) are drawn from with replacement."""
LANES = 4
"""Runs that are taken in turn, so that a small batch is not of one world only; a worker keeps as many worlds."""
TRAIN, HELD_OUT, SHUFFLE = 0, 1, 2


class Numbered(Dataset[dict[str, np.ndarray]]):
    """Sample number n of a run."""

    def __init__(self, source: SampleSource, seed: int) -> None:
        self.source, self.seed = source, seed

    def __getitem__(self, number: int) -> dict[str, np.ndarray]:
        rng = np.random.default_rng([self.seed, TRAIN, number])
        return self.source.sample(self.index(number), rng)

    def index(self, number: int) -> int:
        """Which index of the source it is: runs that share a world are taken four at a time, in turn."""
        run = int(getattr(self.source, "run", 1))
        blocks = len(self.source) // run
        lanes = LANES if run > 1 and blocks >= LANES else 1
        group, within = divmod(number, lanes * run)
        offset, lane = divmod(within, lanes)
        drawn = group * lanes + lane
        if blocks > LARGEST_SHUFFLE:
            block = int(np.random.default_rng([self.seed, SHUFFLE, drawn]).integers(blocks))
        else:
            epoch, place = divmod(drawn, blocks // lanes * lanes)
            block = int(_shuffled(blocks, self.seed, epoch)[place])
        return block * run + offset


class Positions(Sampler[list[int]]):
    """The numbers of one process's samples, batch by batch: of every global batch its own part."""

    def __init__(self, start: int, steps: int, batch: int, rank: int = 0, world: int = 1) -> None:
        self.start, self.steps, self.batch, self.rank, self.world = start, steps, batch, rank, world

    def __len__(self) -> int:
        return self.steps

    def __iter__(self) -> Iterator[list[int]]:
        for step in range(self.steps):
            first = self.start + (step * self.world + self.rank) * self.batch
            yield list(range(first, first + self.batch))


def loader(source: SampleSource, settings: TrainSettings, at: Positions) -> DataLoader[Any]:
    """Batches from that position on. Workers are started afresh, not forked: threads do not survive a fork."""
    workers = worker_count(settings)
    more: dict[str, Any] = {}
    if workers:
        more = {"multiprocessing_context": "forkserver" if os.name == "posix" else "spawn", "prefetch_factor": 4}
    return DataLoader(
        Numbered(source, settings.loop.seed),
        batch_sampler=at,
        num_workers=workers,
        worker_init_fn=_calm if workers else None,
        pin_memory=torch.cuda.is_available(),
        generator=torch.Generator(),  # so that the loader draws nothing from the run's random numbers
        **more,
    )


def held_out_batch(source: SampleSource, settings: TrainSettings) -> Batch:
    """The fixed samples of the learning curve, on the CPU."""
    samples = []
    for number in range(settings.data.held_out):
        rng = np.random.default_rng([settings.loop.seed, HELD_OUT, number])
        samples.append(source.sample(number % len(source), rng))
        check_sample(samples[-1], settings.network, settings.data.size)
    return default_collate(samples)


def worker_count(settings: TrainSettings) -> int:
    """Processes that make samples, for each process that trains."""
    if settings.data.workers is not None:
        return settings.data.workers
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return max(1, cores // settings.loop.devices - 1)


@functools.lru_cache(maxsize=2)
def _shuffled(size: int, seed: int, epoch: int) -> np.ndarray:
    return np.random.default_rng([seed, SHUFFLE, epoch]).permutation(size)


def _calm(worker: int) -> None:
    """One thread per worker, or they get in each other's way."""
    import cv2

    cv2.setNumThreads(1)
    torch.set_num_threads(1)
    use_threads(1)
