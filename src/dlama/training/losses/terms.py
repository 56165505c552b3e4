"""An output and its batch in -> the weighted terms of the generator's and the discriminator's loss out.

Equation 9 of Suvorov et al. 2022 plus terms of depth. A term is a scalar on the autograd graph, already times its weight, so
that the columns of metrics.csv add up to the loss; its name is that of its weight in `LossSettings`.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from dlama.nets.discriminator import Discriminator
from dlama.training.data.batches import Batch, any_hole, hole_planes, pictures
from dlama.training.losses import adversarial, choice, pixels
from dlama.training.losses.pixels import widen_half
from dlama.training.settings import LossSettings, NetworkSettings

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
        planes = 3 * self.network.views
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


def _l1_known(x: LossInputs) -> Tensor:
    output, truth, hole = x.color
    return pixels.masked_l1(output, truth, 1 - hole)


def _l1_hole(x: LossInputs) -> Tensor:
    output, truth, hole = x.color
    return pixels.masked_l1(output, truth, hole)


def _depth_law(x: LossInputs) -> Tensor:
    return pixels.law_penalty(x.depth[0], x.batch["limit"], x.batch["mask"])


def _perceptual(x: LossInputs) -> Tensor:
    """Equation 5 on the colours; of a stereo pair the mean of both views."""
    assert x.perceptual is not None
    truth = pictures(x.batch["target"], x.network)
    return x.perceptual(pictures(x.output, x.network), truth)


def _depth_choice(x: LossInputs) -> Tensor:
    return choice.depth_choice(x.precise_output, x.batch)


def _expected_error(x: LossInputs) -> Tensor:
    return choice.error_likelihood(x.precise_output, x.batch)


@dataclass(frozen=True)
class Term:
    """One term of the generator's loss."""

    value: Callable[[LossInputs], Tensor]
    """Without its weight."""
    of_depth: bool = False
    """Only for networks whose output has depth."""
    of_choice: bool = False
    """Only for the judge of guesses."""
    in_float32: bool = False
    """Computed outside autocast: differences and sums of pixels."""


GENERATOR_TERMS: dict[str, Term] = {
    "l1_known": Term(_l1_known, in_float32=True),
    "l1_hole": Term(_l1_hole, in_float32=True),
    "depth_l1": Term(lambda x: pixels.depth_l1(*x.depth), of_depth=True, in_float32=True),
    "depth_gradient": Term(lambda x: pixels.gradient_matching(*x.depth), of_depth=True, in_float32=True),
    "depth_normal": Term(lambda x: pixels.normal_consistency(*x.depth), of_depth=True, in_float32=True),
    "depth_law": Term(_depth_law, of_depth=True, in_float32=True),
    "depth_choice": Term(_depth_choice, of_choice=True, in_float32=True),
    "expected_error": Term(_expected_error, of_choice=True, in_float32=True),
    "perceptual": Term(_perceptual),
    "adversarial": Term(lambda x: adversarial.generator_loss(widen_half(x.discriminator_outputs[0]))),
    "feature_matching": Term(
        lambda x: adversarial.feature_matching(x.discriminator_outputs[1], x.discriminator_outputs[2])
    ),
}
"""In the order they are computed and added. A new term is an entry here and its weight in `LossSettings`."""
DISCRIMINATOR_TERMS = ("discriminator", "gradient_penalty")


def used_terms(weights: LossSettings, network: NetworkSettings) -> list[str]:
    """Names of the generator's terms that have a weight and that the network has planes for."""
    return [
        name
        for name, term in GENERATOR_TERMS.items()
        if getattr(weights, name)
        and (network.has_depth or not term.of_depth)
        and (network.kind.guesses or not term.of_choice)
    ]


def generator_terms(x: LossInputs) -> Terms:
    """The generator's weighted terms, equations 5, 7 and 9 and those of depth."""
    return {
        name: getattr(x.weights, name) * _value(GENERATOR_TERMS[name], x) for name in used_terms(x.weights, x.network)
    }


def _value(term: Term, x: LossInputs) -> Tensor:
    """A term without its weight, in or out of the autocast that is on."""
    if not term.in_float32:
        return term.value(x)
    with torch.autocast(x.output.device.type, enabled=False):
        return term.value(x)


def discriminator_input(planes: Tensor, batch: Batch) -> Tensor:
    """Planes B x P x H x W as the discriminator gets them: depth without truth is 0 in real and fake ones alike, or it would
    tell them apart by that alone."""
    if "known_depth" not in batch:
        return planes
    return torch.cat([planes[:, :-1], planes[:, -1:] * batch["known_depth"]], 1)


def discriminator_terms(
    discriminator: Discriminator, output: Tensor, batch: Batch, weights: LossSettings, penalty: float | None = None
) -> Terms:
    """The discriminator's terms: equation 6 and R1 of equation 9; `output` (B x P x H x W, 0..1) gets no gradient.

    Args:
        penalty: weight of R1 in this step, 0: none; default: that of the settings.
    """
    strength = weights.gradient_penalty if penalty is None else penalty
    real = discriminator_input(batch["target"], batch).detach().requires_grad_(strength > 0)
    real_scores, _ = discriminator(real)
    fake_scores, _ = discriminator(discriminator_input(output.detach(), batch))
    hole = any_hole(batch["mask"])
    terms = {"discriminator": adversarial.discriminator_loss(widen_half(real_scores), widen_half(fake_scores), hole)}
    if strength:
        terms["gradient_penalty"] = strength * adversarial.gradient_penalty(real_scores, real)
    return terms
