"""Patch scores and activations of a discriminator in -> terms of equations 6, 7 and 9 (Suvorov et al. 2022) out.

Scores are logits, higher = real; softplus(-s) is -log sigmoid(s). Mask 1 = hole, opposite to the paper.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor
from torch.nn.functional import interpolate, mse_loss, softplus

from dlama.training.losses.pixels import widen_half


def discriminator_loss(real: Tensor, fake: Tensor, mask: Tensor) -> Tensor:
    """Equation 6: patches of true pictures are real, patches of the output are fake in the hole and real elsewhere.

    Args:
        real: B x 1 x h x w scores of true pictures.
        fake: the same of the generator's output.
        mask: B x 1 x H x W, 1 = hole; resized to the scores by nearest neighbour.
    """
    hole = interpolate(mask, size=fake.shape[-2:], mode="nearest")
    as_fake = hole * softplus(fake) + (1 - hole) * softplus(-fake)
    return (softplus(-real) + as_fake).mean()


def generator_loss(fake: Tensor) -> Tensor:
    """Equation 7: softplus(-D), the mean over all patches of the output's B x 1 x h x w scores."""
    return softplus(-fake).mean()


def gradient_penalty(real_scores: Tensor, real: Tensor) -> Tensor:
    """R1 of equation 9: mean over the batch of the squared norm of D's gradient at real pictures.

    Args:
        real_scores: B x 1 x h x w, made of `real`, with its graph.
        real: B x P x H x W, requires_grad.
    """
    (gradient,) = torch.autograd.grad(real_scores.sum(), real, create_graph=True)
    return widen_half(gradient).square().flatten(1).sum(1).mean()


def feature_matching(fake: Sequence[Tensor], real: Sequence[Tensor]) -> Tensor:
    """Mean over layers of mean squared differences of the discriminator's activations; `real` gets no gradient."""
    return torch.stack([mse_loss(widen_half(one), widen_half(other.detach())) for one, other in zip(fake, real)]).mean()
