"""Cast shadows from a frame with and without the object, against drawn ones."""

from __future__ import annotations

import warnings

import numpy as np

from dlama.datasets.easysynth.frames import cast_shadow


def test_shadow_is_the_darkened_region_beside_the_object() -> None:
    """Closed form: a disc 30 levels darker beside the object, noise of 3 levels, and a far one that is somebody else's."""
    noise = np.random.default_rng(5).normal(0, 3, (2, 120, 160, 3))
    rows, columns = np.indices((120, 160))
    mask = (abs(rows - 40) < 10) & (abs(columns - 40) < 8)
    disc = (rows - 55) ** 2 + (columns - 55) ** 2 < 12**2
    stranger = (rows - 100) ** 2 + (columns - 145) ** 2 < 8**2
    light = 120 - 30.0 * (disc | stranger)
    source = (np.where(mask, 20, light)[..., None] + noise[0]).clip(0, 255).astype(np.uint8)
    without = (120 + noise[1]).clip(0, 255).astype(np.uint8)
    shadow = cast_shadow(source, without, mask)
    assert shadow is not None and not (shadow & mask).any() and not shadow[stranger].any()
    away = (abs(rows - 40) > 14) | (abs(columns - 40) > 12)  # the mask's edge is neither
    wrong = (shadow ^ disc) & away
    assert wrong.sum() < 0.25 * disc.sum() and (shadow & disc).sum() > 0.8 * (disc & away).sum()


def test_no_shadow_is_told_where_there_is_none() -> None:
    """Noise alone, a brighter region, or another exposure: not known."""
    rng = np.random.default_rng(6)
    without = rng.integers(115, 126, (60, 80, 3)).astype(np.uint8)
    source = rng.integers(115, 126, (60, 80, 3)).astype(np.uint8)
    mask = np.zeros((60, 80), bool)
    mask[20:30, 20:30] = True
    brighter = source.copy()
    brighter[35:50, 20:40] += 40
    for each in (source, brighter, source - 20):
        assert cast_shadow(each, without, mask) is None


def test_an_object_that_fills_the_picture_casts_none_that_is_seen() -> None:
    """Law: nothing is left outside it to compare, which is no warning of numpy either."""
    mask = np.ones((12, 12), bool)
    mask[0] = False
    color = np.zeros((12, 12, 3), np.uint8)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert cast_shadow(color, color, mask) is None
