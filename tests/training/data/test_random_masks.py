"""LaMa's random masks: their statistics as documented, bounds, and the same ones from the same random numbers."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.errors import InputError
from dlama.training.data.masks import MARGIN, SETS, boxes, random_mask, strokes

DOCUMENTED = {"narrow": (0.10, 0.05), "medium": (0.19, 0.09), "wide": (0.29, 0.16)}


@pytest.mark.parametrize("kind", SETS)
@pytest.mark.parametrize("size", [64, 256])
def test_areas(kind: str, size: int) -> None:
    """Mean and spread of the area, at two sizes (oracle: the numbers in the module's first lines)."""
    rng = np.random.default_rng(3)
    shares = np.array([random_mask(rng, (size, size), kind).mean() for _ in range(1000)])
    mean, spread = DOCUMENTED[kind]
    assert abs(shares.mean() - mean) < 3 * spread / np.sqrt(1000) + 1.28 / size  # of 64 pixels strokes are rounded up
    assert abs(shares.std() - spread) < 0.02
    assert shares.min() >= 0.005 and shares.max() <= 0.7


def test_same_numbers_same_mask() -> None:
    """A mask is a function of the generator's state; another state gives another."""
    one, same, other = (random_mask(np.random.default_rng(seed), (48, 80)) for seed in (5, 5, 6))
    assert np.array_equal(one, same) and one.shape == (48, 80) and not np.array_equal(one, other)


def test_strokes_are_as_wide_as_their_set() -> None:
    """Half the width of what is drawn, by distance to the border of the mask (oracle: the set's own numbers)."""
    import cv2

    for name, chosen in SETS.items():
        rng = np.random.default_rng(1)
        single = type(chosen)((1, 1), (1, 1), chosen.length, chosen.width, chosen.boxes, chosen.side)
        for _ in range(30):
            mask = strokes(rng, (256, 256), single)
            inside = cv2.distanceTransform(np.pad(mask, 1).astype(np.uint8), cv2.DIST_L2, 5).max()
            assert inside <= 0.5 * chosen.width[1] * 256 + 2, name


def test_boxes_keep_off_the_border() -> None:
    """The margin stays free on the upper and left side, and a single box is a filled rectangle."""
    rng = np.random.default_rng(2)
    chosen = SETS["medium"]
    one = type(chosen)(chosen.chains, chosen.segments, chosen.length, chosen.width, (1, 1), chosen.side)
    for _ in range(50):
        mask = boxes(rng, (100, 100), one)
        margin = round(100 * MARGIN)
        assert not mask[:margin].any() and not mask[:, :margin].any()
        assert mask.sum() == mask.any(0).sum() * mask.any(1).sum()


def test_unknown_set() -> None:
    """The known ones are listed."""
    with pytest.raises(InputError, match="narrow, medium, wide"):
        random_mask(np.random.default_rng(0), (64, 64), "huge")
