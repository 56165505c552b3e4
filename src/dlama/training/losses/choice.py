"""The judge's output and its batch in -> what the choice of depth costs, and how likely its errors are, out.

Output planes as of `nets.judge.GuessMixer`: three of colour, inverse depth, the logarithms of both expected errors, the weights
of the guesses' depths. Inverse depth is nearness u = w / (w + w0) of inverse depth w, 0 = far.
"""

from __future__ import annotations

import torch
from torch import Tensor

from dlama.training.data.batches import Batch

FIRST_LOG, FIRST_WEIGHT = 4, 6
"""Planes of the output where the log errors and the weights begin."""


def depth_choice(output: Tensor, batch: Batch) -> Tensor:
    """The absolute difference of inverse depth to expect if a guess were drawn by the weights; averaging two never helps.

    Mean over the hole of the samples whose true depth is known there.
    """
    weights, guesses = output[:, FIRST_WEIGHT:], batch["guesses"][:, 3::4]
    wrong = (weights * (guesses - batch["target"][:, 3:4]).abs()).sum(1, keepdim=True)
    return _mean(wrong, batch["mask"] * batch["known_depth"])


def error_likelihood(output: Tensor, batch: Batch) -> Tensor:
    """log b + |error| / b, the mean over the hole, of colour plus of depth: smallest where b is the mean absolute error.

    Colour: mean over channels, where it was unknown. Depth: that of the guess with the largest weight, relative to the truth.
    """
    found, truth = output.detach(), batch["target"]
    wrong_color = (found[:, :3] - truth[:, :3]).abs().mean(1, keepdim=True)
    chosen = found[:, FIRST_WEIGHT:].argmax(1, keepdim=True)
    wrong_depth = relative_error(batch["guesses"][:, 3::4].gather(1, chosen), truth[:, 3:4])
    where = batch["mask"] * batch["context"][:, -1:], batch["mask"] * batch["known_depth"]
    terms = []
    for place, (wrong, counted) in enumerate(zip((wrong_color, wrong_depth), where)):
        log_b = output[:, FIRST_LOG + place : FIRST_LOG + place + 1]
        terms.append(_mean(log_b + wrong * torch.exp(-log_b), counted))
    return torch.stack(terms).sum()


def relative_error(nearness: Tensor, truth: Tensor) -> Tensor:
    """|z - z0| / z0 of depths, 1 at most, from their nearness; both far: 0, one of them: 1."""
    least = 1e-4
    inverse, true = (u / (1 - u).clamp(min=least) for u in (nearness, truth))
    wrong = (true / inverse.clamp(min=least) - 1).abs().clamp(max=1)
    both_far, one_far = (inverse < least) & (true < least), (inverse < least) ^ (true < least)
    return torch.where(both_far, torch.zeros_like(wrong), torch.where(one_far, torch.ones_like(wrong), wrong))


def _mean(values: Tensor, counted: Tensor) -> Tensor:
    """B x 1 x H x W -> mean over all counted pixels of the batch; 0 where there are none."""
    return (values * counted).sum() / counted.sum().clamp(min=1)
