"""The losses agree with the published code's numbers, and with closed forms."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from toy_runs import world_source

from dlama.errors import ShapeError
from dlama.evaluation.metrics.lpips import distance, features
from dlama.nets.architecture import DiscriminatorSettings
from dlama.nets.generator import Discriminator
from dlama.nets.safetensors_file import read_safetensors
from dlama.training.data.batches import check_sample, composite, hole_planes, pictures
from dlama.training.loop.validation import hole_metrics, metric_names, telea
from dlama.training.losses import perceptual, pixels, terms
from dlama.training.losses.perceptual import PerceptualLoss, perceptual_loss, reference_picture
from dlama.training.losses.terms import (
    GENERATOR_TERMS,
    LossInputs,
    discriminator_input,
    discriminator_terms,
    generator_terms,
    used_terms,
)
from dlama.training.settings import LossSettings, NetworkSettings

VECTORS = Path(__file__).parents[2] / "data" / "lama_vectors" / "discriminator_ndf8_n3.safetensors"
RGB = NetworkSettings("rgb")
PUBLISHED = LossSettings().gradient_penalty
PIXELS = LossSettings(adversarial=0.0, feature_matching=0.0, perceptual=0.0)
"""The terms that need no network."""


def number(value):
    """A scalar tensor, off the graph."""
    return float(value.detach() if isinstance(value, torch.Tensor) else value)


@pytest.fixture
def vector():
    """A fresh discriminator in train mode, the batch of it, and the published values."""
    arrays, _, _ = read_safetensors(VECTORS)
    judge = Discriminator(DiscriminatorSettings(3, 8, 3))
    named = {name.removeprefix("state."): array for name, array in arrays.items() if name.startswith("state.")}
    judge.load_state_dict({name: torch.from_numpy(np.array(array)) for name, array in named.items()})
    ends = {k: torch.from_numpy(np.array(v)) for k, v in arrays.items() if not k.startswith("state.")}
    return judge.train(), {"target": ends["real"], "mask": ends["mask"]}, ends


def test_terms_agree_with_the_published_code(vector):
    """Oracle: frozen vector, to 1e-4 relative; equation 6 with R1, and the mask the right way round."""
    judge, batch, ends = vector
    weights = LossSettings(l1_known=0.0, perceptual=0.0)
    found = generator_terms(LossInputs(ends["fake"], batch, RGB, weights, None, judge))
    found |= generator_terms(LossInputs(ends["fake"], batch, RGB, PIXELS))
    found |= discriminator_terms(judge, ends["fake"], batch, PUBLISHED)
    found["discriminator_total"] = found.pop("discriminator") + found["gradient_penalty"]
    found["generator_adversarial"] = found.pop("adversarial")
    assert len(found) == 5
    for name, value in found.items():
        assert number(value) == pytest.approx(number(ends[name]), rel=1e-4), name


def test_only_the_hole_counts_as_fake():
    """Oracle: closed form; scores of 0 cost log 2 each, and a known patch that looks real costs nothing."""
    zeros, mask = torch.zeros(1, 1, 4, 4), torch.zeros(1, 1, 8, 8)
    assert number(terms.discriminator_loss(zeros, zeros, mask)) == pytest.approx(2 * math.log(2))
    sure, mask[..., :4] = torch.full((1, 1, 4, 4), 50.0), 1
    assert number(terms.discriminator_loss(sure, sure, mask)) == pytest.approx(25.0)


def test_gradient_penalty_has_its_weight(vector):
    """Oracle: closed form; the term is the weight of the step times R1, and there is none of weight 0."""
    judge, batch, ends = vector
    scored = batch["target"].clone().requires_grad_()
    plain = number(terms.gradient_penalty(judge(scored)[0], scored))
    found = [discriminator_terms(judge, ends["fake"], batch, penalty) for penalty in (4.0, 0.0)]
    assert number(found[0]["gradient_penalty"]) == pytest.approx(4 * plain, rel=1e-4)
    assert list(found[1]) == ["discriminator"]


def test_lpips_as_a_loss_is_the_measure():
    """Oracle: LPIPS as the evaluation runs it; and its gradient is finite where a picture equals the truth."""
    rng = np.random.default_rng(0)
    both = [rng.integers(0, 256, (64, 80, 3), np.uint8) for _ in range(2)]
    mine, theirs = (torch.from_numpy(one.transpose(2, 0, 1)[None] / np.float32(255)) for one in both)
    loss = perceptual_loss(LossSettings(trunk="lpips"))
    assert number(loss(mine, theirs)) == pytest.approx(distance(*map(features, both)), rel=1e-3)
    same = theirs.clone().requires_grad_(True)
    loss(same, theirs).backward()
    assert torch.isfinite(same.grad).all()


def test_perceptual_loss_is_a_mean_of_means():
    """Oracle: closed form of equation 5 for a trunk of two layers of different sizes."""

    class Second(torch.nn.Module):
        def forward(self, x):
            return x[:, :1, ::2, ::2] * 2

    loss = PerceptualLoss(torch.nn.Sequential(torch.nn.Identity(), Second()))
    truth = torch.rand(2, 3, 8, 8)
    std = torch.tensor(perceptual.IMAGENET_STD)
    first, second = (0.1 / std).square().mean(), (0.2 / std[0]).square()
    expected = (torch.stack([first, second]) * loss.scales).mean()
    assert number(loss(truth + 0.1, truth)) == pytest.approx(number(expected), rel=1e-5)


def test_layers_of_the_trunk_count_alike():
    """Oracle: closed form; against a trunk that sees nothing, each layer of the reference picture counts 1."""
    loss = perceptual_loss(LossSettings())
    picture = reference_picture()
    layers = loss.activations(picture)
    assert [number(layer.square().mean() * scale) for layer, scale in zip(layers, loss.scales)] == pytest.approx(
        [1.0] * len(layers)
    )
    assert 0.2 < number(picture.std()) < 0.26 and torch.equal(picture, reference_picture())


def test_stereo_pairs_are_two_pictures():
    """Oracle: closed form; both views go through the trunk, left ones first."""
    planes = torch.arange(2 * 6.0).view(2, 6, 1, 1)
    assert pictures(planes, NetworkSettings("stereo"))[:, :, 0, 0].tolist() == [
        [0, 1, 2], [6, 7, 8], [3, 4, 5], [9, 10, 11],
    ]  # fmt: skip
    masks = torch.tensor([[[[0.0]], [[1.0]]]])
    assert hole_planes(masks, 6)[0, :, 0, 0].tolist() == [0, 0, 0, 1, 1, 1]


def plane(a: float, b: float, c: float, size: int = 16):
    """Inverse depth of a plane: affine in the picture."""
    v, u = torch.meshgrid(torch.linspace(0, 1, size), torch.linspace(0, 1, size), indexing="ij")
    return (a * u + b * v + c)[None, None]


def test_depth_terms_of_planes():
    """Oracle: closed forms; an offset costs L1 alone, a tilt costs its gradient, and equal planes cost nothing."""
    truth, known = plane(0.2, 0.1, 0.3), torch.ones(1, 1, 16, 16)
    moved, tilted = truth + 0.25, truth + plane(0.3, 0, 0)
    assert number(pixels.depth_l1(moved, truth, known)) == pytest.approx(0.25)
    assert number(pixels.gradient_matching(moved, truth, known)) == pytest.approx(0, abs=1e-6)
    assert number(pixels.normal_consistency(moved, truth, known)) == pytest.approx(0, abs=1e-6)
    step = 0.3 / 15  # per pixel; each scale doubles it
    assert number(pixels.gradient_matching(tilted, truth, known)) == pytest.approx(step * (1 + 2 + 4 + 8) / 4, rel=1e-4)
    slopes = [np.array([-a * 16 / 15, -0.1 * 16 / 15, 1.0]) for a in (0.2, 0.5)]
    cosine = number(slopes[0] @ slopes[1] / np.prod([np.linalg.norm(s) for s in slopes]))
    assert number(pixels.normal_consistency(tilted, truth, known)) == pytest.approx(1 - cosine, rel=1e-3)


def test_unknown_depth_counts_nowhere():
    """Oracle: law; nonsense where no truth is known changes no term, though it has neighbours."""
    truth, known = plane(0.2, 0.1, 0.3), torch.ones(1, 1, 16, 16)
    known[..., 4:9, 5:11] = 0
    output = truth + plane(0.1, 0.2, 0.05)
    for term in (pixels.depth_l1, pixels.gradient_matching, pixels.normal_consistency):
        before = term(output, truth, known)
        other = torch.where(known > 0, truth, torch.full_like(truth, 0.9))
        assert number(before) > 0
        assert number(term(output, other, known)) == pytest.approx(number(before), rel=1e-5)


def test_the_law_is_one_sided_and_counts_the_hole():
    """Oracle: closed form; nearer than allowed costs the excess, farther costs nothing, infinity allows anything."""
    hole = torch.zeros(1, 1, 4, 4)
    hole[..., :2] = 1
    limit = torch.full((1, 1, 4, 4), 0.5)
    allowed = 0.5 * (1 + pixels.TOLERANCE)
    assert number(pixels.law_penalty(torch.full_like(limit, 0.8), limit, hole)) == pytest.approx(0.8 - allowed)
    assert number(pixels.law_penalty(torch.full_like(limit, 0.4), limit, hole)) == 0
    output = torch.full_like(limit, 0.8).requires_grad_()
    free = pixels.law_penalty(output, torch.full_like(limit, math.inf), hole)
    free.backward()
    assert number(free) == 0 and output.grad is not None and not output.grad.any()


def four_scenes(source):
    """The first four samples, as one batch."""
    samples = [source.sample(i, np.random.default_rng(i)) for i in range(4)]
    return {key: torch.stack([torch.from_numpy(sample[key]) for sample in samples]) for key in samples[0]}


def test_terms_of_halves_are_those_of_the_whole():
    """Oracle: law; the mean over two half batches is the mean over the batch, whatever their holes and unknown pixels."""
    network = NetworkSettings("rgbd")
    batch = four_scenes(world_source(network, 32, "train"))
    batch["known_depth"][1, :, :9] = 0
    output = torch.rand(4, 4, 32, 32, generator=torch.Generator().manual_seed(0))
    weights = replace(PIXELS, l1_hole=1.0)
    whole = generator_terms(LossInputs(output, batch, network, weights))
    halves = [
        generator_terms(LossInputs(output[i : i + 2], {k: v[i : i + 2] for k, v in batch.items()}, network, weights))
        for i in (0, 2)
    ]
    assert set(whole) == {"l1_known", "l1_hole", "depth_l1", "depth_gradient", "depth_normal", "depth_law"}
    for name, value in whole.items():
        assert number(value) == pytest.approx(number(halves[0][name] + halves[1][name]) / 2, rel=1e-5)


def test_every_term_has_a_weight():
    """Oracle: the settings; without its weight a term is not computed, and terms of depth need a plane of depth."""
    nothing = dict.fromkeys(GENERATOR_TERMS, 0.0)
    assert used_terms(LossSettings(**nothing), NetworkSettings("rgbd")) == []
    for name in GENERATOR_TERMS:
        weights = LossSettings(**nothing | {name: 2.0})
        assert used_terms(weights, NetworkSettings("rgbd")) == [name]
        of_depth = name in ("depth_l1", "depth_gradient", "depth_normal", "depth_law")
        assert used_terms(weights, NetworkSettings("rgb")) == ([] if of_depth else [name])


def test_the_discriminator_sees_no_depth_without_truth():
    """Oracle: law; real and fake are equal there."""
    batch = {"known_depth": torch.zeros(1, 1, 4, 4)}
    assert not discriminator_input(torch.rand(1, 4, 4, 4), batch)[:, -1].any()
    assert discriminator_input(torch.ones(1, 6, 4, 4), {}).all()


@pytest.mark.parametrize(
    ("key", "change"),
    [
        ("mask", lambda x: x * 0),
        ("mask", lambda x: x * 0.5),
        ("input", lambda x: x + 0.1),
        ("target", lambda x: x * np.float32(np.nan)),
        ("target", lambda x: x[:, :-1]),
        ("known_depth", lambda x: x.astype(np.float64)),
    ],
)
def test_samples_off_the_contract_are_refused(key, change):
    """Oracle: law; the message names the key."""
    network = NetworkSettings("rgbd")
    sample = world_source(network, 32, "train").sample(0, np.random.default_rng(0))
    with pytest.raises(ShapeError, match=key):
        check_sample(sample | {key: change(sample[key])}, network, 32)


def test_metrics_of_the_truth_and_of_telea():
    """Oracle: closed form; the truth is perfect, a grey hole has the truth's distance from grey, Telea is in between."""
    network = NetworkSettings("rgbd")
    batch = four_scenes(world_source(network, 64, "held_out"))
    perfect = hole_metrics(batch["target"], batch, network)
    assert list(perfect) == metric_names(network)
    assert perfect["color_l1"] == perfect["depth_l1"] == perfect["law_broken"] == 0
    assert perfect["color_psnr"] == pytest.approx(100)
    grey = hole_metrics(torch.full_like(batch["target"], 0.5), batch, network)
    diffused = telea(batch)
    torch.testing.assert_close(composite(diffused, batch), diffused, rtol=0, atol=0.5 / 255 + 1e-6)
    assert 0 < hole_metrics(diffused, batch, network)["color_l1"] < grey["color_l1"]
