"""Settings are read from shapes alone, and a file that is half of a network is refused by name."""

from __future__ import annotations

import pytest

from dlama.errors import ShapeError
from dlama.nets.architecture import (
    GeneratorSettings,
    generator_shapes,
    settings_from_state,
)


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


@pytest.mark.parametrize("wrong", [{"blocks": 0}, {"activation": "relu"}, {"global_ratio": 1.0}, {"global_ratio": 0.0}])
def test_numbers_no_generator_has(wrong):
    """Oracle: the settings' own documentation."""
    with pytest.raises(ShapeError, match="generator"):
        GeneratorSettings(**wrong)


def test_sizes_the_network_takes():
    """Oracle: three halvings must leave two pixels to reflect."""
    assert (GeneratorSettings().multiple, GeneratorSettings().minimum) == (8, 16)
