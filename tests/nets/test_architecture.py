"""Settings are read from shapes alone, and a file that is half of a network is refused by name."""

from __future__ import annotations

import pytest

from dlama.errors import ShapeError
from dlama.nets.architecture import (
    GeneratorSettings,
    generator_shapes,
    settings_from_state,
)

SMALL = GeneratorSettings(width=8, blocks=1)


def test_every_published_name_and_shape(big_lama_shapes):
    """Oracle: the list of the published big-lama's tensors."""
    assert generator_shapes(GeneratorSettings()) == big_lama_shapes
    assert settings_from_state(big_lama_shapes) == GeneratorSettings()


@pytest.mark.parametrize(
    "settings",
    [
        GeneratorSettings(5, 4, 8, 3, 2),
        GeneratorSettings(7, 6, 16, 2, 1, 0.5),
        GeneratorSettings(2, 1, 8, 4, 3, 0.75, "tanh"),
        GeneratorSettings(4, 3, 300, 3, 1),
    ],
)
def test_settings_come_back_from_shapes(settings):
    """Oracle: round trip."""
    assert settings_from_state(generator_shapes(settings), settings.activation) == settings


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda s: s.pop("model.5.conv2.ffc.convg2l.weight"), r"1 missing: model\.5\.conv2\.ffc\.convg2l\.weight"),
        (lambda s: s.update({"model.5.gate.weight": (1,)}), r"1 not part of it: model\.5\.gate\.weight"),
        (lambda s: s.update({"model.5.conv1.bn_g.bias": (47,)}), r"model\.5\.conv1\.bn_g\.bias is 47, expected 48"),
        (lambda s: s.pop("model.1.ffc.convl2l.weight"), r"no tensor 'model\.1\.ffc\.convl2l\.weight'; the first of"),
        (lambda s: s.update({"model.17.weight": (3,)}), r"model\.17\.weight: shape 3, expected 4 dimensions"),
    ],
)
def test_the_first_name_that_differs_is_named(change, message):
    """Oracle: the change itself."""
    shapes = generator_shapes(SMALL)
    change(shapes)
    with pytest.raises(ShapeError, match=message):
        settings_from_state(shapes)


@pytest.mark.parametrize("wrong", [{"blocks": 0}, {"activation": "relu"}, {"global_ratio": 1.0}, {"global_ratio": 0.0}])
def test_numbers_no_generator_has(wrong):
    """Oracle: the settings' own documentation."""
    with pytest.raises(ShapeError, match="generator"):
        GeneratorSettings(**wrong)


def test_sizes_the_network_takes():
    """Oracle: three halvings must leave two pixels to reflect."""
    assert (GeneratorSettings().multiple, GeneratorSettings().minimum) == (8, 16)
