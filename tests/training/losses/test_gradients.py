"""The losses together have the gradients of finite differences in float64: nothing is cut off the graph. (torch makes them.)"""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch

from dlama.nets.architecture import DiscriminatorSettings
from dlama.nets.generator import Discriminator
from dlama.training.losses import terms
from dlama.training.losses.terms import GENERATOR_TERMS, LossInputs, generator_terms
from dlama.training.settings import LossSettings, NetworkSettings

NOTHING = LossSettings(**dict.fromkeys(GENERATOR_TERMS, 0.0))
"""No term has a weight."""


@pytest.fixture(autouse=True)
def seeded():
    """The same numbers every time: at a kink of ReLU finite differences are no gradient, and these are away from kinks."""
    with torch.random.fork_rng():
        torch.manual_seed(3)
        yield


def numbers(*shape: int):
    """Float64 in 0..1 that want a gradient."""
    return torch.rand(*shape, dtype=torch.float64, requires_grad=True)


def test_gradient_penalty_at_the_weights():
    """Oracle: finite differences of a gradient's norm, so this is the second derivative."""
    judge = torch.nn.Sequential(torch.nn.Conv2d(2, 3, 3), torch.nn.Softplus(), torch.nn.Conv2d(3, 1, 3)).double()
    real = numbers(2, 2, 8, 8)

    def penalty(weight, bias):
        scores = torch.func.functional_call(judge, {"0.weight": weight, "0.bias": bias}, (real,))
        return terms.gradient_penalty(scores, real)

    assert torch.autograd.gradcheck(penalty, (judge[0].weight, judge[0].bias))


def test_terms_through_the_discriminator():
    """Oracle: finite differences at the output, batch norms in train mode."""
    network = NetworkSettings("rgbd")
    judge = Discriminator(DiscriminatorSettings(4, 2, 1)).double().train()
    target = torch.rand(1, 4, 8, 8, dtype=torch.float64)
    batch = {"target": target, "known_depth": (torch.rand(1, 1, 8, 8) > 0.3).double()}
    weights = replace(NOTHING, adversarial=1.0, feature_matching=1.0)
    for name in ("adversarial", "feature_matching"):
        assert torch.autograd.gradcheck(
            lambda x, name=name: generator_terms(LossInputs(x, batch, network, weights, None, judge))[name],
            numbers(1, 4, 8, 8),
        )


def test_pixel_terms_together():
    """Oracle: finite differences of the weighted sum."""
    network, weights = (
        NetworkSettings("rgbd"),
        LossSettings(l1_hole=2.0, adversarial=0.0, feature_matching=0.0, perceptual=0.0),
    )
    planes = {"target": 4, "mask": 1, "known_depth": 1, "limit": 1}
    batch = {key: torch.rand(1, count, 8, 8, dtype=torch.float64) for key, count in planes.items()}
    batch |= {key: batch[key].round() for key in ("mask", "known_depth")}
    assert torch.autograd.gradcheck(
        lambda x: torch.stack(list(generator_terms(LossInputs(x, batch, network, weights)).values())).sum(),
        numbers(1, 4, 8, 8),
    )
