"""Known colours spread into all others (oracles: closed forms on constant pictures, what is known comes back, ranges)."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.inpainters.spreading import pull_push, spread_small, telea_spread

HW = (40, 60)
DRIFT = 8
"""Grey levels by which OpenCV's Telea leaves a constant picture 20 px from what is known: it rounds each pixel from those before
it."""


def known_pixels(hw: tuple[int, int] = HW) -> np.ndarray:
    """Twenty columns at the right are unknown, and three in ten of the rest."""
    known = np.random.default_rng(1).random(hw) > 0.3
    known[:, -20:] = False
    return known


@pytest.mark.parametrize("spread", [pull_push, telea_spread, spread_small])
@pytest.mark.parametrize("hw", [HW, (30, 700)])
def test_one_value_stays_itself(spread, hw):
    """Closed form, also of what is spread in a smaller picture."""
    known = known_pixels(hw)
    color = np.where(known[..., None], np.array([200, 100, 50], np.uint8), np.uint8(0))
    wanted = np.broadcast_to(color[known][0], color.shape)
    np.testing.assert_allclose(spread(color, known), wanted, atol=DRIFT)


def test_what_is_asked_for_is_what_all_is_there():
    """Law: the pixels of `where` alone are those of the whole, in a picture that is spread smaller, too."""
    for hw in (HW, (30, 700)):
        known = known_pixels(hw)
        color = np.random.default_rng(3).integers(0, 256, (*hw, 3), np.uint8) * known[..., None]
        where = ~known & (np.random.default_rng(4).random(hw) > 0.5)
        np.testing.assert_array_equal(spread_small(color, known, where), spread_small(color, known)[where])


def test_pull_push_keeps_what_is_known_and_stays_between():
    """Laws: known values come back bit for bit; a mean of known values lies within their range."""
    known = known_pixels()
    values = np.random.default_rng(2).integers(90, 160, (*HW, 3)).astype(np.float32) * known[..., None]
    mean = pull_push(values, known)
    np.testing.assert_array_equal(mean[known], values[known])
    assert mean.min() >= 89.9 and mean.max() <= 159.1


@pytest.mark.parametrize("spread", [pull_push, telea_spread, spread_small])
def test_nothing_known_is_no_error(spread):
    """Law: the shape stays, all values are finite."""
    values = np.zeros((*HW, 3), np.float32)
    assert np.isfinite(spread(values, np.zeros(HW, bool))).all()
