"""A network's weights, step by step, in -> their moving average, which is what is validated and exported, out."""

from __future__ import annotations

import copy

import torch
from torch import nn


def average_of(network: nn.Module) -> nn.Module:
    """A copy in eval mode that takes no gradient."""
    return copy.deepcopy(network).eval().requires_grad_(False)


@torch.no_grad()
def follow(average: nn.Module, network: nn.Module, memory: float, step: int) -> None:
    """One step: average = memory x average + (1 - memory) x network, with a shorter memory in the first steps.

    Batch norms' statistics are averaged as well (they forget within ten batches by themselves); counters are copied.
    """
    memory = min(memory, (1 + step) / (10 + step))
    for mine, theirs in zip(average.state_dict().values(), network.state_dict().values(), strict=True):
        if mine.is_floating_point():
            mine.lerp_(theirs.to(mine.dtype), 1 - memory)
        else:
            mine.copy_(theirs)
