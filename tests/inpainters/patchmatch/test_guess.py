"""The rough guess that patches begin with. Oracle: closed forms."""

import numpy as np

from dlama.geometry.rgbd import BoolArray, UInt8Array
from dlama.inpainters.patchmatch.filler import GUESS_SIDE, guess_coarsely


def test_a_painter_sees_a_large_picture_small_and_without_the_hole() -> None:
    """Closed form: a picture of one colour with another in its hole reaches the painter without that other, GUESS_SIDE px wide;
    known pixels come back as they were, the hole as it was painted."""
    picture = np.full((500, 2 * GUESS_SIDE, 3), 90, np.uint8)
    hole = np.zeros(picture.shape[:2], bool)
    hole[200:301, 400:601] = True
    picture[hole] = 255

    def paint(small: UInt8Array, of: BoolArray, seed: int) -> UInt8Array:
        assert small.shape == (250, GUESS_SIDE, 3) and seed == 3
        assert (small[~of] == 90).all() and 0.9 < of.sum() * 4 / hole.sum() < 1.1
        return np.where(of[..., None], np.uint8(40), small)

    out = guess_coarsely(paint, picture, hole, 3)
    np.testing.assert_array_equal(out[~hole], picture[~hole])
    assert (out[210:290, 410:590] == 40).all()


def test_a_small_picture_is_painted_as_it_is() -> None:
    """Closed form."""
    picture, hole = np.zeros((20, 30, 3), np.uint8), np.zeros((20, 30), bool)
    assert guess_coarsely(lambda given, of, seed: given + np.uint8(seed), picture, hole, 7).max() == 7
