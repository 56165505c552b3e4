"""An output and its batch in -> every term of the generator's and the discriminator's loss, weighted, out.

Equation 9 of the paper plus the terms of depth. A term is a number on the autograd graph, already times its weight, so that
the columns of metrics.csv can be added up; its name is that of its weight in `LossSettings`.
"""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor
from torch.nn.functional import l1_loss

from dlama.nets.discriminator import Discriminator
from dlama.training import adversarial
from dlama.training.data.batches import Batch, any_hole, hole_planes, pictures
from dlama.training.depth_losses import depth_l1, gradient_matching, law_penalty, normal_consistency
from dlama.training.perceptual import PerceptualLoss
from dlama.training.precision import precise
from dlama.training.settings import LossSettings, NetworkSettings

Terms = dict[str, Tensor]
DEPTH_TERMS: dict[str, Callable[[Tensor, Tensor, Tensor], Tensor]] = {
    "depth_l1": depth_l1,
    "depth_gradient": gradient_matching,
    "depth_normal": normal_consistency,
}


def masked_l1(output: Tensor, truth: Tensor, weight: Tensor) -> Tensor:
    """Mean over all pixels of weight x |output - truth|, as published: the weight is not divided out."""
    return (weight * l1_loss(output, truth, reduction="none")).mean()


def pixel_terms(output: Tensor, batch: Batch, weights: LossSettings, network: NetworkSettings) -> Terms:
    """The terms that need no network: colour where it was known, depth everywhere. Float32 also inside autocast.

    Args:
        output: B x P x H x W, 0..1.
        batch: see `batches.Batch`.
    """
    with torch.autocast(output.device.type, enabled=False):
        output = precise(output)
        colors = 3 * network.views
        mine, true = output[:, :colors], batch["target"][:, :colors]
        hole = hole_planes(batch["mask"], colors)
        terms: Terms = {}
        if weights.l1_known:
            terms["l1_known"] = weights.l1_known * masked_l1(mine, true, 1 - hole)
        if weights.l1_hole:
            terms["l1_hole"] = weights.l1_hole * masked_l1(mine, true, hole)
        return terms | (_depth_terms(output[:, -1:], batch, weights) if network.has_depth else {})


def _depth_terms(depth: Tensor, batch: Batch, weights: LossSettings) -> Terms:
    truth, known = batch["target"][:, -1:], batch["known_depth"]
    terms = {
        name: getattr(weights, name) * term(depth, truth, known)
        for name, term in DEPTH_TERMS.items()
        if getattr(weights, name)
    }
    if weights.depth_law:
        terms["depth_law"] = weights.depth_law * law_penalty(depth, batch["limit"], batch["mask"])
    return terms


def perceptual_term(
    output: Tensor, batch: Batch, weights: LossSettings, network: NetworkSettings, loss: PerceptualLoss
) -> Terms:
    """Equation 5 on the colours; of a stereo pair the mean of both views."""
    truth = pictures(batch["target"], network)
    return {"perceptual": weights.perceptual * loss(pictures(output, network), truth)}


def judged_planes(planes: Tensor, batch: Batch) -> Tensor:
    """What the discriminator sees: depth without truth is 0 for both sides, or it would tell them apart by that alone."""
    if "known_depth" not in batch:
        return planes
    return torch.cat([planes[:, :-1], planes[:, -1:] * batch["known_depth"]], 1)


def judged_terms(judge: Discriminator, output: Tensor, batch: Batch, weights: LossSettings) -> Terms:
    """The generator's terms that come from the discriminator: equation 7 and feature matching; real first, then fake."""
    terms: Terms = {}
    real_features: list[Tensor] = []
    if weights.feature_matching:
        with torch.no_grad():
            _, real_features = judge(judged_planes(batch["target"], batch))
    scores, features = judge(judged_planes(output, batch))
    if weights.adversarial:
        terms["adversarial"] = weights.adversarial * adversarial.generator_loss(precise(scores))
    if weights.feature_matching:
        terms["feature_matching"] = weights.feature_matching * adversarial.feature_matching(features, real_features)
    return terms


def discriminator_terms(
    judge: Discriminator, output: Tensor, batch: Batch, weights: LossSettings, penalty: float | None = None
) -> Terms:
    """The discriminator's terms: equation 6 and R1; `output` gets no gradient.

    Args:
        penalty: weight of R1 in this step; default as the settings say, 0: none.
    """
    strength = weights.gradient_penalty if penalty is None else penalty
    real = judged_planes(batch["target"], batch).detach().requires_grad_(strength > 0)
    real_scores, _ = judge(real)
    fake_scores, _ = judge(judged_planes(output.detach(), batch))
    hole = any_hole(batch["mask"])
    terms = {"discriminator": adversarial.discriminator_loss(precise(real_scores), precise(fake_scores), hole)}
    if strength:
        terms["gradient_penalty"] = strength * adversarial.gradient_penalty(real_scores, real)
    return terms
