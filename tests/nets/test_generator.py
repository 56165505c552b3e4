"""The torch modules agree with the published code's numbers."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dlama.errors import ShapeError
from dlama.nets.architecture import (
    DiscriminatorSettings,
    GeneratorSettings,
    generator_shapes,
)
from dlama.nets.generator import Discriminator, FourierUnit, Generator, generator_from_state


def test_generator_agrees_with_the_published_code(generator_vector):
    """Oracle: frozen vector; the output spreads by 0.02 only, so anything looser than 1e-6 would prove nothing."""
    state, ends = generator_vector
    with torch.inference_mode():
        output = generator_from_state(state)(torch.from_numpy(ends["input"].copy())).numpy()
    np.testing.assert_allclose(output, ends["output"], rtol=0, atol=1e-6)
    assert ends["output"].std() > 1e-2


def test_one_changed_weight_is_seen(generator_vector):
    """The guard above can fail: a Fourier weight moved by 1 % moves the output by more than its tolerance."""
    state, ends = generator_vector
    name = "model.6.conv2.ffc.convg2g.fu.conv_layer.weight"
    with torch.inference_mode():
        output = generator_from_state(state | {name: state[name] * 1.01})(torch.from_numpy(ends["input"].copy()))
    assert np.abs(output.numpy() - ends["output"]).max() > 1e-6


def test_discriminator_agrees_with_the_published_code(discriminator_vector):
    """Oracle: frozen vector, scores and every activation."""
    state, ends = discriminator_vector
    with torch.inference_mode():
        judge = Discriminator(DiscriminatorSettings(3, 8, 3))
        judge.load_state_dict({name: torch.from_numpy(np.array(array)) for name, array in state.items()})
        scores, features = judge.eval()(torch.from_numpy(ends["real"].copy()))
    np.testing.assert_allclose(scores, ends["eval_scores_real"], rtol=0, atol=1e-5)
    assert len(features) == 4
    for i, feature in enumerate(features):
        np.testing.assert_allclose(feature, ends[f"eval_feature_{i}"], rtol=0, atol=1e-5)


@pytest.mark.parametrize("settings", [GeneratorSettings(5, 4, 8, 3, 2), GeneratorSettings(7, 6, 8, 2, 1, 0.5, "tanh")])
def test_modules_have_the_published_names(settings):
    """Oracle: the architecture's list, which is held to the published one elsewhere."""
    shapes = {name: tuple(tensor.shape) for name, tensor in Generator(settings).state_dict().items()}
    assert shapes == generator_shapes(settings)


@pytest.mark.slow
def test_every_parameter_learns():
    """Oracle: law; a gradient reaches every parameter of both networks."""
    picture = torch.rand(2, 4, 32, 40)
    generator, judge = (
        Generator(GeneratorSettings(width=8, blocks=1)),
        Discriminator(DiscriminatorSettings(width=8, layers=2)),
    )
    scores, features = judge(generator(picture))
    (scores.mean() + sum(feature.mean() for feature in features)).backward()
    for net in (generator, judge):
        assert all(p.grad is not None and p.grad.abs().sum() > 0 for p in net.parameters())


@pytest.mark.slow
def test_fourier_unit_stays_exact_under_autocast():
    """Oracle: itself without autocast; half-precision FFTs do not exist on 24 x 20."""
    unit = FourierUnit(2).eval()
    picture = torch.rand(1, 2, 24, 20)
    with torch.inference_mode():
        alone = unit(picture)
        with torch.autocast("cpu", dtype=torch.bfloat16):
            torch.testing.assert_close(unit(picture), alone, rtol=0, atol=0)


@pytest.mark.parametrize("shape", [(1, 3, 32, 32), (1, 4, 30, 32), (1, 4, 8, 32), (4, 32, 32)])
def test_sizes_it_cannot_take_are_refused(shape):
    """Oracle: the settings' multiple, minimum and channels."""
    with pytest.raises(ShapeError, match="generator: "):
        Generator(GeneratorSettings(width=8, blocks=1))(torch.zeros(shape))
