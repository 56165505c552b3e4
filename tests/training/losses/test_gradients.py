"""Gradients of the Fourier convolution and of every loss agree with finite differences in float64."""

from __future__ import annotations

from dataclasses import replace

import pytest

torch = pytest.importorskip("torch", reason="training needs torch: pip install 'dlama[train]'")

from dlama.nets.architecture import DiscriminatorSettings  # noqa: E402
from dlama.nets.ffc import FFC_BN_ACT, FourierUnit, SpectralTransform  # noqa: E402
from dlama.nets.generator import Discriminator  # noqa: E402
from dlama.training.losses import pixels, terms, trunks  # noqa: E402
from dlama.training.losses.perceptual import PerceptualLoss  # noqa: E402
from dlama.training.losses.terms import GENERATOR_TERMS, LossInputs, generator_terms  # noqa: E402
from dlama.training.settings import LossSettings, NetworkSettings  # noqa: E402

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


@pytest.fixture
def double_fourier(monkeypatch):
    """The Fourier unit computes in float32 whatever comes; here it must not."""
    monkeypatch.setattr(torch.Tensor, "float", torch.Tensor.double)


@pytest.mark.parametrize("size", [(4, 6), (5, 7)])
@pytest.mark.parametrize("train", [False, True])
def test_fourier_unit(double_fourier, size, train):
    """Oracle: finite differences, at the input and at the weights; even and odd sizes."""
    unit = FourierUnit(2).double().train(train)
    unit.bn.running_var.fill_(0.5)
    weight = unit.conv_layer.weight
    assert torch.autograd.gradcheck(lambda x, _: unit(x), (numbers(2, 2, *size), weight))


def test_spectral_transform(double_fourier):
    """Oracle: finite differences."""
    part = SpectralTransform(4, 4).double().eval()
    assert torch.autograd.gradcheck(part, numbers(1, 4, 4, 4))


def test_fast_fourier_convolution(double_fourier):
    """Oracle: finite differences through both branches."""
    layer = FFC_BN_ACT((2, 4), (2, 4), kernel=3, padding=1).double().train()
    assert torch.autograd.gradcheck(lambda a, b: layer((a, b)), (numbers(1, 2, 4, 4), numbers(1, 4, 4, 4)))


def test_adversarial_terms():
    """Oracle: finite differences at the scores."""
    mask = (torch.rand(2, 1, 8, 8) > 0.5).double()
    real, fake = numbers(2, 1, 4, 4), numbers(2, 1, 4, 4)
    assert torch.autograd.gradcheck(lambda r, f: terms.discriminator_loss(r, f, mask), (real, fake))
    assert torch.autograd.gradcheck(terms.generator_loss, fake)
    layers = [numbers(1, 2, 4, 4).detach(), numbers(1, 3, 2, 2).detach()]
    assert torch.autograd.gradcheck(
        lambda a, b: terms.feature_matching([a, b], layers), (numbers(1, 2, 4, 4), numbers(1, 3, 2, 2))
    )


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


@pytest.mark.parametrize("term", (pixels.depth_l1, pixels.gradient_matching, pixels.normal_consistency))
def test_depth_terms(term):
    """Oracle: finite differences, with unknown pixels."""
    truth = torch.rand(2, 1, 8, 8, dtype=torch.float64)
    known = (torch.rand(2, 1, 8, 8) > 0.2).double()
    assert torch.autograd.gradcheck(lambda x: term(x, truth, known), numbers(2, 1, 8, 8))


def test_law_penalty():
    """Oracle: finite differences, where some pixels break the law, some keep it and some have none."""
    limit = torch.rand(2, 1, 6, 6, dtype=torch.float64)
    limit[:, :, :2] = torch.inf
    hole = (torch.rand(2, 1, 6, 6) > 0.3).double()
    assert torch.autograd.gradcheck(lambda x: pixels.law_penalty(x, limit, hole), numbers(2, 1, 6, 6))


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


def test_perceptual_loss():
    """Oracle: finite differences through the dilated trunk of our own."""
    loss = PerceptualLoss(trunks.random_trunk(2), "random").double()
    truth = torch.rand(1, 3, 48, 48, dtype=torch.float64)
    assert torch.autograd.gradcheck(lambda x: loss(x, truth), numbers(1, 3, 48, 48), fast_mode=True)


def test_this_guard_can_fail():
    """A gradient that is off by a hundredth is seen."""

    class Off(torch.autograd.Function):
        @staticmethod
        def forward(ctx, x):
            return x.square().sum()

        @staticmethod
        def backward(ctx, gradient):
            return gradient * torch.full((3,), 2.0, dtype=torch.float64)

    with pytest.raises(RuntimeError, match="Jacobian mismatch"):
        torch.autograd.gradcheck(Off.apply, torch.tensor([0.99, 1.0, 1.01], dtype=torch.float64, requires_grad=True))
