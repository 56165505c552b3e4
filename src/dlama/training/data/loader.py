"""A source and a sample number in -> the batches of a run from there on, the same ones however often it was stopped, out.

Sample number n of a run is a function of the seed and n alone: its index comes from a shuffling of the source that is new
in every epoch, its random numbers from a generator seeded with (seed, n). A run resumes at the number of samples it has used.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from torch.utils.data import DataLoader, Dataset, default_collate

from dlama.models.network_file import processor_count
from dlama.training.data.batches import Batch, check_sample
from dlama.training.data.sources import SampleSource
from dlama.training.settings import TrainSettings
from dlama.workers.threads import limit_threads

GROUPS_IN_TURN = 4
"""Groups of indices that samples are taken from in turn, so that a batch shows several worlds; a worker caches as many."""
TRAIN, HELD_OUT, SHUFFLE = 0, 1, 2
"""Second number of the seeds: for the random numbers of samples, of held-out samples, and of the shuffling."""


class NumberedSamples(Dataset[dict[str, np.ndarray]]):
    """Torch's view of a source: sample number n of the run with this seed."""

    def __init__(self, source: SampleSource, seed: int) -> None:
        self.source, self.seed = source, seed

    def __getitem__(self, number: int) -> dict[str, np.ndarray]:
        rng = np.random.default_rng([self.seed, TRAIN, number])
        return self.source.sample(self.index(number), rng)

    def index(self, number: int) -> int:
        """Index of the source for sample `number`: groups of indices are shuffled, then GROUPS_IN_TURN groups are interleaved."""
        size = int(getattr(self.source, "group_size", 1))
        groups = len(self.source) // size
        in_turn = GROUPS_IN_TURN if size > 1 and groups >= GROUPS_IN_TURN else 1
        block, within = divmod(number, in_turn * size)
        offset, column = divmod(within, in_turn)
        drawn = block * in_turn + column
        epoch, place = divmod(drawn, groups // in_turn * in_turn)
        return int(_shuffle(groups, self.seed, epoch)[place]) * size + offset


def batch_numbers(start: int, steps: int, batch: int, rank: int = 0, world: int = 1) -> list[range]:
    """Sample numbers of one process's batches, from sample `start` on; `rank` of `world` takes its part of every global batch."""
    firsts = (start + (step * world + rank) * batch for step in range(steps))
    return [range(first, first + batch) for first in firsts]


def batch_loader(source: SampleSource, settings: TrainSettings, at: Sequence[range]) -> DataLoader[Any]:
    """Batches of these sample numbers. Workers are new processes, not forked ones: threads do not survive a fork."""
    workers = settings.data.workers
    if workers is None:  # for each process that trains
        workers = max(1, processor_count() // settings.loop.devices - 1)
    more: dict[str, Any] = {}
    if workers:
        more = {"multiprocessing_context": "forkserver" if os.name == "posix" else "spawn", "prefetch_factor": 4}
    return DataLoader(
        NumberedSamples(source, settings.loop.seed),
        batch_sampler=at,
        num_workers=workers,
        worker_init_fn=_single_thread,
        pin_memory=torch.cuda.is_available(),
        generator=torch.Generator(),  # so that the loader draws nothing from the run's random numbers
        **more,
    )


def held_out_batch(source: SampleSource, settings: TrainSettings) -> Batch:
    """The fixed samples of validation, on the CPU."""
    samples = []
    for number in range(settings.data.held_out):
        rng = np.random.default_rng([settings.loop.seed, HELD_OUT, number])
        samples.append(source.sample(number % len(source), rng))
        check_sample(samples[-1], settings.network, settings.data.size)
    return default_collate(samples)


@functools.lru_cache(maxsize=2)
def _shuffle(size: int, seed: int, epoch: int) -> np.ndarray:
    return np.random.default_rng([seed, SHUFFLE, epoch]).permutation(size)


def _single_thread(worker: int) -> None:
    """One thread per worker process, as torch has it there by itself: together they use all cores."""
    limit_threads(1)
