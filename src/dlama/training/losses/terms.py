"""An output and its batch in -> the weighted terms of the generator's and the discriminator's loss out.

Equation 9 of Suvorov et al. 2022 plus terms of depth. A term is a scalar on the autograd graph, already times its weight, so
that the columns of metrics.csv add up to the loss; its name is that of its weight in `LossSettings`.

Equations 6, 7 and 9: scores are logits, higher = real; softplus(-s) is -log sigmoid(s). Mask 1 = hole, opposite to the paper.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn.functional import interpolate, mse_loss, softplus

from dlama.nets.generator import Discriminator
from dlama.training.data.batches import Batch, hole_planes, pictures
from dlama.training.losses import pixels
from dlama.training.losses.pixels import widen_half
from dlama.training.settings import LossSettings, NetworkSettings


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


Terms = dict[str, Tensor]
"""Name -> weighted scalar."""


@dataclass(eq=False)
class LossInputs:
    """All that a term of the generator's loss may read; what several terms need is computed once."""

    output: Tensor
    """B x P x H x W of the generator, 0..1, any precision."""
    batch: Batch
    network: NetworkSettings
    weights: LossSettings
    perceptual: Callable[[Tensor, Tensor], Tensor] | None = None
    """The perceptual loss, where its weight is not 0."""
    discriminator: Discriminator | None = None
    """Where a term of it has a weight."""

    @functools.cached_property
    def precise_output(self) -> Tensor:
        """The output in float32 or better."""
        return widen_half(self.output)

    @functools.cached_property
    def color(self) -> tuple[Tensor, Tensor, Tensor]:
        """Colour planes of output and truth, and the hole of each; B x 3V x H x W."""
        planes = 3 * self.network.kind.views
        return (
            self.precise_output[:, :planes],
            self.batch["target"][:, :planes],
            hole_planes(self.batch["mask"], planes),
        )

    @functools.cached_property
    def depth(self) -> tuple[Tensor, Tensor, Tensor]:
        """Inverse depth of output and truth, and where it is known; B x 1 x H x W."""
        plane = self.network.kind.outputs - 1
        return self.precise_output[:, plane : plane + 1], self.batch["target"][:, -1:], self.batch["known_depth"]

    @functools.cached_property
    def discriminator_outputs(self) -> tuple[Tensor, Sequence[Tensor], Sequence[Tensor]]:
        """Scores and activations of the discriminator at the output, and its activations at the truth (none where feature
        matching has no weight). The truth goes first: the order shows in the running statistics of batch norms."""
        assert self.discriminator is not None
        real_features: Sequence[Tensor] = []
        if self.weights.feature_matching:
            with torch.no_grad():
                _, real_features = self.discriminator(discriminator_input(self.batch["target"], self.batch))
        scores, features = self.discriminator(discriminator_input(self.output, self.batch))
        return scores, features, real_features


def _perceptual(x: LossInputs) -> Tensor:
    """Equation 5 on the colours; of a stereo pair the mean of both views."""
    assert x.perceptual is not None
    truth = pictures(x.batch["target"], x.network)
    return x.perceptual(pictures(x.output, x.network), truth)


GENERATOR_TERMS: dict[str, Callable[[LossInputs], Tensor]] = {
    "l1_known": lambda x: pixels.masked_l1(x.color[0], x.color[1], 1 - x.color[2]),
    "l1_hole": lambda x: pixels.masked_l1(*x.color),
    "depth_l1": lambda x: pixels.depth_l1(*x.depth),
    "depth_gradient": lambda x: pixels.gradient_matching(*x.depth),
    "depth_normal": lambda x: pixels.normal_consistency(*x.depth),
    "depth_law": lambda x: pixels.law_penalty(x.depth[0], x.batch["limit"], x.batch["mask"]),
    "perceptual": _perceptual,
    "adversarial": lambda x: softplus(-widen_half(x.discriminator_outputs[0])).mean(),  # equation 7
    "feature_matching": lambda x: feature_matching(x.discriminator_outputs[1], x.discriminator_outputs[2]),
}
"""Each without its weight, in the order they are computed and added; those called depth_ are of networks whose output has depth.
A new term is an entry here and its weight in `LossSettings`."""


def used_terms(weights: LossSettings, network: NetworkSettings) -> list[str]:
    """Names of the generator's terms that have a weight and that the network has planes for."""
    return [
        name
        for name in GENERATOR_TERMS
        if getattr(weights, name) and (network.kind.has_depth or not name.startswith("depth_"))
    ]


def generator_terms(x: LossInputs) -> Terms:
    """The generator's weighted terms, equations 5, 7 and 9 and those of depth."""
    return {name: getattr(x.weights, name) * GENERATOR_TERMS[name](x) for name in used_terms(x.weights, x.network)}


def discriminator_input(planes: Tensor, batch: Batch) -> Tensor:
    """Planes B x P x H x W as the discriminator gets them: depth without truth is 0 in real and fake ones alike, or it would
    tell them apart by that alone."""
    if "known_depth" not in batch:
        return planes
    return torch.cat([planes[:, :-1], planes[:, -1:] * batch["known_depth"]], 1)


def discriminator_terms(discriminator: Discriminator, output: Tensor, batch: Batch, penalty: float) -> Terms:
    """The discriminator's terms: equation 6, and R1 of equation 9 by its weight in this step (0: none); `output`
    (B x P x H x W, 0..1) gets no gradient."""
    real = discriminator_input(batch["target"], batch).detach().requires_grad_(penalty > 0)
    real_scores, _ = discriminator(real)
    fake_scores, _ = discriminator(discriminator_input(output.detach(), batch))
    hole = batch["mask"].amax(1, keepdim=True)  # of any view
    terms = {"discriminator": discriminator_loss(widen_half(real_scores), widen_half(fake_scores), hole)}
    if penalty:
        terms["gradient_penalty"] = penalty * gradient_penalty(real_scores, real)
    return terms
