"""LaMa's random masks: their statistics as documented, bounds, and the same ones from the same random numbers."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.training.data import masks
from dlama.training.data.masks import MARGIN, boxes, random_mask

DOCUMENTED = (0.29, 0.16)


@pytest.mark.parametrize("size", [64, 256])
def test_areas(size: int) -> None:
    """Mean and spread of the area, at two sizes (oracle: the numbers in the module's first lines)."""
    rng = np.random.default_rng(3)
    shares = np.array([random_mask(rng, (size, size)).mean() for _ in range(1000)])
    mean, spread = DOCUMENTED
    assert abs(shares.mean() - mean) < 3 * spread / np.sqrt(1000) + 1.28 / size  # of 64 pixels strokes are rounded up
    assert abs(shares.std() - spread) < 0.02
    assert shares.min() >= 0.005 and shares.max() <= 0.7


def test_same_numbers_same_mask() -> None:
    """A mask is a function of the generator's state; another state gives another."""
    one, same, other = (random_mask(np.random.default_rng(seed), (48, 80)) for seed in (5, 5, 6))
    assert np.array_equal(one, same) and one.shape == (48, 80) and not np.array_equal(one, other)


def test_boxes_keep_off_the_border(monkeypatch: pytest.MonkeyPatch) -> None:
    """The margin stays free on the upper and left side, and a single box is a filled rectangle."""
    rng = np.random.default_rng(2)
    monkeypatch.setattr(masks, "BOXES", (1, 1))
    for _ in range(50):
        mask = boxes(rng, (100, 100))
        margin = round(100 * MARGIN)
        assert not mask[:margin].any() and not mask[:, :margin].any()
        assert mask.sum() == mask.any(0).sum() * mask.any(1).sum()
