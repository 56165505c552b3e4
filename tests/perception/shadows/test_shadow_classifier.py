"""The shadow's classifiers and network: their contracts, a slow twin, closed forms of what they see, and what can be said without
any training."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from dlama.models.network_file import shipped_network
from dlama.perception.shadows.classifier import (
    CLIP,
    MODEL,
    PARTS,
    Classifier,
    classifiers,
    shadow_probability,
)
from dlama.perception.shadows.features import (
    CANDIDATE_FEATURES,
    candidate_features,
    cast_interiors,
    pixel_features,
    tone_steps,
)
from dlama.perception.shadows.ground import SIDE, crop_around
from dlama.perception.shadows.planes import (
    FIRST_CAST,
    LOG_RANGE,
    LOG_SHARE,
    MULTIPLE,
    NETWORK,
    PLANES,
    ShadowPlanes,
    darkness_by_hue,
    network_planes,
    network_probability,
)

FLAT = np.zeros((len(PLANES), 96, 128), np.float32)
FLAT[4:6] = 1  # surface all over the picture
FLAT[3, 30:60, 50:70], FLAT[4, 30:60, 50:70] = 1, 0


def with_shape() -> np.ndarray:
    """An object on an even surface whose shape was thrown to its right."""
    planes = FLAT.copy()
    planes[FIRST_CAST, 50:60, 72:100] = 0.5
    return planes


def test_the_file_that_ships_fits_the_features() -> None:
    """Contract: each part takes as many features as are made, and gives one probability a row."""
    parts = classifiers()
    assert tuple(parts) == tuple(PARTS) and MODEL.stat().st_size < 100_000
    planes = ShadowPlanes(with_shape())
    candidates = candidate_features(planes, cast_interiors(planes))
    assert candidates.shape == (len(PLANES[FIRST_CAST:]) + 2, CANDIDATE_FEATURES)
    rows, where = pixel_features(planes, planes.casts[0] > 0, 0.5)
    assert len(rows) == where.sum() == planes.surface.sum()
    for part, features in (("candidate", np.nan_to_num(candidates)), ("pixel", rows)):
        said = parts[part](features)
        assert said.shape == (len(features),) and (said >= 0).all() and (said <= 1).all()


def test_the_network_that_ships_fits_the_planes() -> None:
    """Contract: it takes the planes that are made, at sides that crops have, and gives one probability a pixel of the surface."""
    assert NETWORK.stat().st_size < 500_000 and SIDE % MULTIPLE == 0
    assert next(iter(shipped_network(NETWORK).inputs.values()))[1][1] == len(network_planes(ShadowPlanes(FLAT)))
    said = network_probability(ShadowPlanes(FLAT))
    assert said.shape == FLAT.shape[1:] and (said >= 0).all() and (said <= 1).all()
    assert not said[FLAT[4] < 0.5].any()


def test_a_perceptron_against_its_literal_twin() -> None:
    """Oracle: one sample and one neuron at a time."""
    rng = np.random.default_rng(0)
    sizes = (5, 4, 3, 1)
    layers = tuple((rng.normal(size=(a, b)), rng.normal(size=b)) for a, b in itertools.pairwise(sizes))
    mean, spread = rng.normal(size=5), rng.uniform(0.1, 2, 5)
    samples = rng.normal(0, 4, (7, 5))
    said = Classifier(mean, spread, layers)(samples)
    for sample, value in zip(samples, said):
        h = [min(max((x - m) / s, -CLIP), CLIP) for x, m, s in zip(sample, mean, spread)]
        for number, (weight, bias) in enumerate(layers):
            h = [x if number == 0 else max(x, 0.0) for x in h]
            h = [sum(x * w for x, w in zip(h, column)) + b for column, b in zip(weight.T, bias)]
        assert value == pytest.approx(1 / (1 + math.exp(-h[0])), rel=1e-5)


def test_on_an_even_surface_there_is_no_shadow() -> None:
    """Nothing is darker than anything else: whatever was thrown there, it is none."""
    assert shadow_probability(ShadowPlanes(FLAT)) is None
    assert shadow_probability(ShadowPlanes(with_shape())) is None


def test_a_crop_and_back() -> None:
    """Round trip: a square of a picture lies where it was, up to a pixel at its border, and nothing outside the crop is known."""
    mask = np.zeros((400, 600), np.bool_)
    mask[150:250, 300:340] = True
    crop = crop_around(mask)
    square = np.zeros(mask.shape, np.float32)
    square[200:300, 350:420] = 1
    back = crop.large(np.asarray(crop.small(square), np.float32), mask.shape)
    apart = (back > 0.5) ^ (square > 0.5)
    assert apart.sum() <= 2 * (100 + 70)
    outside = np.ones(mask.shape, np.bool_)
    outside[crop.rows, crop.columns] = False
    assert outside.any() and not back[outside].any()


@pytest.mark.parametrize("stained", [False, True])
def test_a_shadow_darkens_all_tones_alike(stained: bool) -> None:
    """Closed form: on columns of many levels a shadow of one step shifts every percentile by it; a stain of the dark third of
    them shifts those alone."""
    planes = FLAT.copy()
    level = np.tile((np.arange(planes.shape[2]) // 4 % 6 - 2.5) / 10, (planes.shape[1], 1)).astype(np.float32)
    region = np.zeros(level.shape, np.bool_)
    region[66:90, 12:108] = True
    darker = 0.3 * (region & (level < -0.1)) if stained else 0.3 * region
    planes[:3] = (level - darker) / LOG_RANGE
    *steps, light, least = tone_steps(ShadowPlanes(planes), region)
    if stained:
        assert steps[1] == pytest.approx(0.3, abs=0.07) and abs(steps[-2]) < 0.07 and least < 0.2
    else:
        np.testing.assert_allclose(steps, 0.3, atol=0.07)
        assert light == pytest.approx(1, abs=0.25) and least == pytest.approx(1, abs=0.25)


def test_how_common_colours_are() -> None:
    """Closed form: the shares of a surface of two colours are those of their pixels, and what is dark would be as common as the
    lit part if it was lit."""
    planes = FLAT.copy()
    planes[:3, 80:, 64:] = -0.45 / 2  # darker by one of the steps that lit partners are looked for at
    where = planes[4] > 0.5
    dark = planes[0][where] < -0.1
    share, raised, _ = (plane[where] for plane in network_planes(ShadowPlanes(planes))[len(PLANES) :])
    expected = np.log((~dark).sum() / dark.sum())
    assert LOG_SHARE * (share[~dark].mean() - share[dark].mean()) == pytest.approx(expected, abs=0.05)
    assert LOG_SHARE * raised[dark].mean() == pytest.approx(expected, abs=0.05)


def test_darkness_by_hue() -> None:
    """Closed form: a rug that is darker than the floor all over is not dark by its hue; a shadow over both is, by one step."""
    planes = FLAT.copy()
    planes[:3, :, :64] += np.array([-0.1, -0.4, -0.35], np.float32)[:, None, None]  # logarithms / 2
    shadow = np.zeros(FLAT.shape[1:], np.bool_)
    shadow[60:70, 20:110] = True
    planes[:3, shadow] -= 0.2
    found = darkness_by_hue(ShadowPlanes(planes))
    inner = np.zeros_like(shadow)
    inner[64:67] = shadow[64:67]
    rug, floor = np.arange(128) < 60, np.arange(128) > 70
    for side in (rug, floor):
        lit = (planes[4] > 0.5) & side & ~shadow
        lit[56:74] = False
        assert found[inner & side].mean() - found[lit].mean() == pytest.approx(0.4, abs=0.02)
        assert abs(found[lit].mean()) < 0.08
    assert not found[planes[4] < 0.5].any()
